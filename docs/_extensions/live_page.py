"""The live page: puts its scripts, its engine and the released models beside docs/live/index.md when the site is built.

The engine comes from npm: `python docs/make_site.py` gets it. Without it the page is there and says that it is
missing, and Sphinx warns.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path

import numpy as np
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging
from sphinx.util.typing import ExtensionMetadata

from deepmuon_runtime import Generator, Model
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.family import at_depth
from deepmuon_runtime.model.metadata import SPHERE
from deepmuon_runtime.model.released import read_released, released_model, serving_models

__all__ = ["setup"]

PAGE = "live"
LINKED_FILE = re.compile(r'(?:href|src)="(\.\./_static/[^"#]+)"')
OFFSET = 0.7  # m, as in models.js
RATES = 65
MODEL_FIELDS = (
    "name",
    "sha256",
    "architecture",
    "flux",
    "medium",
    "surface",
    "depth_m",
    "depth_min_m",
    "depth_max_m",
    "muons_per_draw",
    "latent_size",
    "energy_min_gev",
    "energy_max_gev",
    "rate_hz_per_m2",
)


def build_live_page(app: Sphinx, exception: Exception | None) -> None:
    """Put together what the page needs."""
    if exception is not None or app.builder.format != "html":
        return
    source, target = Path(app.srcdir, PAGE), Path(app.outdir, PAGE)
    for script in [*source.rglob("*.js"), *source.glob("*.css")]:
        copy = target / script.relative_to(source)
        copy.parent.mkdir(exist_ok=True)
        shutil.copy(script, copy)
    if (source / "engine").exists():
        shutil.copytree(source / "engine", target / "engine", dirs_exist_ok=True)
    else:
        logging.getLogger(__name__).warning(
            "the live page has no engine, which npm brings: build the site with python docs/make_site.py"
        )
    write_models(Path(app.srcdir, "evaluations"), target)
    write_kept_files(target)


def write_models(evaluations: Path, target: Path) -> None:
    """Write the released models, and models.json, which describes them."""
    folder = target / "models"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    models, default = serving_models(), released_model(0)
    for model in models:
        (folder / model.name).write_bytes(read_released(model))
    released = {
        "default": default.name,
        "models": [describe(model, default, evaluations) for model in models],
    }
    (target / "models.json").write_text(json.dumps(released), encoding="utf-8")


def describe(model: Model, default: Model, evaluations: Path) -> dict[str, object]:
    """Return what the page needs to know of a model: docs/live/models.js has it in words."""
    if model.rate_hz_per_m2 is None and not model.is_family:
        raise ExtensionError(f"the live page needs the rate of {model.name}, which does not know it")
    evaluation = evaluations / f"{Path(model.name).stem}.json"
    held_out = read_held_out(evaluation) if evaluation.exists() else None
    is_default = (model.flux, model.medium) == (default.flux, default.medium)
    return {field: getattr(model, field) for field in MODEL_FIELDS} | {
        "options": "" if is_default else f"--flux {model.flux} --medium {model.medium} ",
        "held_out": held_out,
        "held_out_at": read_held_out_at(evaluation.with_suffix("")) if model.is_family else None,
        "rates": read_rates(model),
        "has_sphere": has_sphere(model),
    }


def has_sphere(model: Model) -> bool:
    """Tell whether a model is a family with the flux through a sphere, which targets need."""
    if not model.is_family:
        return False
    try:
        at_depth(read_released(model), model.depth_m, SPHERE)
    except RefusedError:
        return False
    return True


def read_held_out_at(evaluations: Path) -> list[tuple[float, dict[str, list[int]]]]:
    """Return the depths [m] at which a family was judged by muons through a plane, and how these are distributed."""
    files = {float(file.stem[:-1]): file for file in evaluations.glob("*m.json")}
    return [(depth, read_held_out(file)) for depth, file in sorted(files.items())]


def read_rates(model: Model) -> list[tuple[float, float | None]] | None:
    """Return the rates of a family at depths close enough to interpolate between, or None if it is none."""
    if model.depth_min_m is None or model.depth_max_m is None:
        return None
    least, most = np.log([model.depth_min_m + OFFSET, model.depth_max_m + OFFSET])
    between = np.exp(np.linspace(least, most, RATES)) - OFFSET
    depths = [model.depth_min_m, *between[1:-1].tolist(), model.depth_max_m]
    which = {"architecture": model.architecture, "flux": model.flux, "medium": model.medium}
    return [(depth, Generator.open(depth, **which).model.rate_hz_per_m2) for depth in depths]


def read_held_out(evaluation: Path) -> dict[str, list[int]]:
    """Return how the muons that a model was judged by are distributed."""
    spectra = json.loads(evaluation.read_text(encoding="utf-8"))["held_out_spectra"]
    by_energy = [sum(counts) for counts in zip(spectra["plus_by_energy"], spectra["minus_by_energy"], strict=True)]
    return {"by_energy": by_energy, "by_cos_zenith": spectra["by_cos_zenith"]}


def write_kept_files(target: Path) -> None:
    """Write kept_files.js: what the service worker keeps for use without a network, and a version of all of it."""
    here = [file for file in target.rglob("*") if file.is_file() and file.name != "kept_files.js"]
    linked = LINKED_FILE.findall((target / "index.html").read_text(encoding="utf-8"))
    files = sorted([file.relative_to(target).as_posix() for file in here] + linked)
    contents = (target.joinpath(file.partition("?")[0]).read_bytes() for file in files)
    version = hashlib.sha256(b"".join(hashlib.sha256(content).digest() for content in contents)).hexdigest()
    kept = json.dumps({"version": version, "files": files}, indent=4)
    (target / "kept_files.js").write_text(f"self.KEPT = {kept};\n", encoding="utf-8")


def setup(app: Sphinx) -> ExtensionMetadata:
    """Build the page after Sphinx has written it."""
    app.connect("build-finished", build_live_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
