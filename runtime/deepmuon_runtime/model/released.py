"""The models that come with the package."""

from __future__ import annotations

import hashlib
import json
from importlib.resources import files
from numbers import Real
from typing import Any

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import Model

__all__ = ["default_architecture", "list_models", "read_released", "released_model"]

PACKAGE = "deepmuon_models"
MANIFEST_VERSION = 1


def list_models() -> list[Model]:
    """Return the released models, by architecture and depth.

    Raises
    ------
    RefusedError
        If the package was installed without its models.
    """
    models = []
    for entry in _manifest()["models"]:
        name, sha256, size = entry.pop("file"), entry.pop("sha256"), entry.pop("size")
        models.append(Model.from_metadata(entry, name, sha256, size))
    return sorted(models, key=lambda model: (model.architecture, model.depth_m))


def default_architecture() -> str:
    """Return the architecture that is taken where none is named: the one that measured best."""
    return str(_manifest()["default_architecture"])


def released_model(depth: float, architecture: str | None = None) -> Model:
    """Return the released model of a depth: a family where there is one, else the model of that depth alone.

    Parameters
    ----------
    depth
        Metres of water; any number in the range of a family.
    architecture
        "quantile" or "transformer"; the default one if left out.

    Raises
    ------
    RefusedError
        If there is none; the text lists those there are.
    """
    if not isinstance(depth, Real):
        raise RefusedError(f"the depth {depth!r} is no number: give metres, such as depth=10")
    wanted = architecture or default_architecture()
    models = list_models()
    architectures = sorted({model.architecture for model in models})
    if wanted not in architectures:
        raise RefusedError(f"no released model is a {wanted!r}: {_there_are(architectures)}")
    models = sorted((model for model in models if model.architecture == wanted), key=lambda model: not model.is_family)
    for model in models:
        if model.has_depth(float(depth)):
            return model
    depths = [model.depths for model in models]
    raise RefusedError(f"no {wanted} model for a depth of {depth:g} m: {_there_are(depths)} m")


def read_released(model: Model) -> bytes:
    """Return the bytes of a released model, checked against the hash in the manifest.

    Raises
    ------
    RefusedError
        If the file is missing or is not the released one.
    """
    try:
        content = files(PACKAGE).joinpath(model.name).read_bytes()
    except OSError as error:
        raise RefusedError(f"the released model {model.name} is missing: install deepmuon-runtime again") from error
    found = hashlib.sha256(content).hexdigest()
    if found != model.sha256:
        raise RefusedError(
            f"the released model {model.name} is damaged: its SHA-256 is {found}, and should be "
            f"{model.sha256}; install deepmuon-runtime again"
        )
    return content


def _manifest() -> dict[str, Any]:
    try:
        manifest: dict[str, Any] = json.loads(files(PACKAGE).joinpath("manifest.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RefusedError("the released models are missing: install deepmuon-runtime again") from error
    if manifest.get("manifest_version") != MANIFEST_VERSION:
        raise RefusedError("the released models are not this release's: install deepmuon-runtime again")
    return manifest


def _there_are(names: list[str]) -> str:
    if len(names) == 1:
        return f"there is {names[0]}"
    return f"there are {', '.join(names[:-1])} and {names[-1]}"
