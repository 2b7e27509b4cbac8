"""The models that come with the package."""

from __future__ import annotations

import hashlib
import json
from importlib.resources import files
from numbers import Real
from typing import Any

from deepmuon_runtime.errors import RefusedError, shown
from deepmuon_runtime.model.metadata import Model, is_name

__all__ = [
    "DEFAULT_FLUX",
    "DEFAULT_MEDIUM",
    "default_architecture",
    "list_models",
    "models_of",
    "read_released",
    "released_model",
    "serving_models",
]

PACKAGE = "deepmuon_models"
MANIFEST_VERSION = 1

DEFAULT_FLUX, DEFAULT_MEDIUM = "cry", "water"
"""What is taken where no flux and no medium is named."""


def list_models() -> list[Model]:
    """Return the released models by architecture, flux, medium and depth; the defaults and families come first.

    Raises
    ------
    RefusedError
        If the package was installed without its models.
    """
    models = []
    for entry in _manifest()["models"]:
        name, sha256, size = entry.pop("file"), entry.pop("sha256"), entry.pop("size")
        models.append(Model.from_metadata(entry, name, sha256, size))
    return sorted(models, key=_place)


def serving_models() -> list[Model]:
    """Return the released models that serve depths: not those of one depth that a family has, which are for embedding.

    Raises
    ------
    RefusedError
        If the package was installed without its models.
    """
    models = list_models()
    families = [model for model in models if model.is_family]
    return [model for model in models if model.is_family or not any(_holds(family, model) for family in families)]


def default_architecture() -> str:
    """Return the architecture that is taken where none is named: the one that measured best."""
    return str(_manifest()["default_architecture"])


def models_of(architecture: str | None = None, flux: str | None = None, medium: str | None = None) -> list[Model]:
    """Return the released models that serve the depths of an architecture, a flux and a medium.

    Parameters
    ----------
    architecture, flux, medium
        As for `released_model`.

    Raises
    ------
    RefusedError
        If there is none; the text says what there is.
    """
    models = _of_architecture(architecture)
    flux, medium = DEFAULT_FLUX if flux is None else flux, DEFAULT_MEDIUM if medium is None else medium
    found = [model for model in models if (model.flux, model.medium) == (flux, medium)]
    if not found:
        sort = "model" if architecture is None else architecture
        asked = f"{_printable(flux)} in {_printable(medium)}"
        raise RefusedError(f"no released {sort} of flux {asked}: {_there_are(list(_depths(models)))}")
    return found


def released_model(
    depth: float, architecture: str | None = None, flux: str | None = None, medium: str | None = None
) -> Model:
    """Return the released model of a depth: a family where one has it, else the model of that depth alone.

    Parameters
    ----------
    depth
        Metres of the medium; any number in the range of a family.
    architecture
        "quantile" or "transformer"; the default one if left out.
    flux
        At sea level, "cry" or "measured"; "cry" if left out.
    medium
        Above the muons, "water" or "rock"; "water" if left out.

    Raises
    ------
    RefusedError
        If there is none; the text says what there is.
    """
    if not isinstance(depth, Real):
        raise RefusedError(f"the depth {depth!r} is no number: give metres, such as depth=10")
    models = models_of(architecture, flux, medium)
    for model in models:
        if model.has_depth(float(depth)):
            return model
    one = models[0]
    there = "; ".join(f"{name} has {depths} m" for name, depths in _depths(_of_architecture(architecture)).items())
    raise RefusedError(
        f"no {one.architecture} model of flux {one.flux} for a depth of {depth:g} m of {one.medium}: {there}"
    )


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


def _place(model: Model) -> tuple[str, bool, str, bool, str, bool, float]:
    """Return what a model is sorted by."""
    flux, medium = model.flux, model.medium
    at = (not model.is_family, model.depth_m)
    return model.architecture, flux != DEFAULT_FLUX, flux, medium != DEFAULT_MEDIUM, medium, *at


def _holds(family: Model, model: Model) -> bool:
    """Tell whether a family has the muons of a model of one depth."""
    alike = all(getattr(family, name) == getattr(model, name) for name in ("architecture", "flux", "medium"))
    return alike and family.has_depth(model.depth_m)


def _of_architecture(architecture: str | None) -> list[Model]:
    """Return the models that serve the depths of an architecture, the default one if it is None."""
    models, wanted = serving_models(), default_architecture() if architecture is None else architecture
    found = [model for model in models if model.architecture == wanted]
    if not found:
        raise RefusedError(
            f"no released model is a {wanted!r}: {_there_are(sorted({model.architecture for model in models}))}"
        )
    return found


def _depths(models: list[Model]) -> dict[str, str]:
    """Return which depths there are of each flux and medium, in words."""
    depths: dict[str, list[str]] = {}
    for model in models:
        depths.setdefault(f"{model.flux} in {model.medium}", []).append(model.depths)
    return {name: _joined(those) for name, those in depths.items()}


def _printable(name: object) -> str:
    """Return what a user calls a flux or a medium, as it can stand in a line."""
    return shown(name if isinstance(name, str) and is_name(name) else repr(name))


def _there_are(names: list[str]) -> str:
    return f"there {'is' if len(names) == 1 else 'are'} {_joined(names)}"


def _joined(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
