"""Engines that run ONNX files, each behind one call, and the muons that they have to give."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from functools import cache, partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

__all__ = [
    "ENGINES",
    "FAMILIES",
    "MODELS",
    "TOLERANCE",
    "Difference",
    "Engine",
    "Muons",
    "difference",
    "expected",
    "latents_of",
    "reference_evaluator",
]

TESTS = Path(__file__).parents[1]
RELEASED = TESTS.parent / "models" / "deepmuon_models"
JAVASCRIPT = TESTS / "engines" / "node_modules"

_MANIFEST = json.loads((RELEASED / "manifest.json").read_text("utf-8"))["models"]
MODELS = tuple(RELEASED / entry["file"] for entry in _MANIFEST if "depth_min_m" not in entry)
"""The released models of one depth."""

FAMILIES = tuple(RELEASED / entry["file"] for entry in _MANIFEST if "depth_min_m" in entry)
"""The released families."""

OUTPUTS = ["kinetic_energy", "direction", "charge"]
RATE = "rate_hz_per_m2"


class Muons(NamedTuple):
    """What a model gives: energy [n] in GeV, direction [n, 3], charge [n]."""

    kinetic_energy: np.ndarray
    direction: np.ndarray
    charge: np.ndarray


class Difference(NamedTuple):
    """The largest between two sets of muons: of the energy relative, of a direction absolute; and how many charges."""

    energy: float
    direction: float
    charges: int


TOLERANCE = Difference(energy=2e-5, direction=2e-6, charges=0)
"""What float32 explains: the network or the tables magnify its rounding, 6e-8, some thirty times, and the energy is the
ninth power of what they give."""


class Engine(NamedTuple):
    """A program that runs ONNX files.

    Parameters
    ----------
    package
        Of PyPI or npm.
    version
        Of the package.
    missing
        Why it can't run here, or nothing.
    run
        Makes the muons of a model, of the latents of its test vectors.
    """

    package: str
    version: Callable[[], str]
    missing: Callable[[], str]
    run: Callable[[Path], Muons]


def vectors_file(model: Path) -> Path:
    """Return the test vectors of a released model, or of another one those that lie beside it."""
    return (TESTS / "vectors" if model in MODELS else model.parent) / f"{model.stem}.json"


def read_vectors(model: Path) -> dict[str, Any]:
    return json.loads(vectors_file(model).read_text("utf-8"))


def latents_of(model: Path) -> np.ndarray:
    """Return the latents of a model's test vectors, float32 [draws, latent_size]."""
    vectors = read_vectors(model)
    return np.float32(vectors["latent"]).reshape(vectors["draws"], -1)


def expected(model: Path) -> Muons:
    """Return the muons of a model's test vectors, which PyTorch made in double precision."""
    return as_muons(read_vectors(model))


def as_muons(columns: dict[str, list[float]]) -> Muons:
    energy, direction, charge = (np.array(columns[name]) for name in OUTPUTS)
    return Muons(energy, direction.reshape(-1, 3), charge)


def difference(found: Muons, right: Muons) -> Difference:
    """Compare muons with the right ones."""
    return Difference(
        float(np.max(np.abs(found.kinetic_energy / right.kinetic_energy - 1))),
        float(np.max(np.abs(found.direction - right.direction))),
        int(np.sum(found.charge != right.charge)),
    )


def python(package: str, module: str, run: Callable[[Path], Muons]) -> Engine:
    """Return an engine that is a Python package."""
    missing = "" if find_spec(module) else f"{package} is not installed"
    return Engine(package, partial(version, package), lambda: missing, run)


def javascript(package: str) -> Engine:
    """Return an engine that is an npm package."""
    description = JAVASCRIPT / package / "package.json"
    missing = "" if description.exists() else f"{package} is not installed: `npm ci` in tests/engines does that"
    return Engine(
        package,
        lambda: json.loads(description.read_text("utf-8"))["version"],
        lambda: missing,
        lambda model: run_in_node(package, MODELS if model in MODELS else (model,))[str(model)],
    )


@cache
def run_in_node(package: str, models: tuple[Path, ...]) -> dict[str, Muons]:
    """Run models in one process: compiling the engine is what takes time."""
    files = [str(file) for model in models for file in (model, vectors_file(model))]
    node = subprocess.run(["node", JAVASCRIPT.parent / "run.js", package, *files], stdout=subprocess.PIPE, check=True)
    return {model: as_muons(columns) for model, columns in json.loads(node.stdout).items()}


def run_in_onnxruntime(model: Path, provider: str = "CPUExecutionProvider", **options: str) -> Muons:
    import onnxruntime

    if provider == "CUDAExecutionProvider":
        onnxruntime.preload_dlls(directory="")  # CUDA's, as pip installs them
    session = onnxruntime.InferenceSession(model, providers=[(provider, options)])
    assert session.get_providers()[0] == provider, "ONNX Runtime took another device"
    return Muons(*session.run(OUTPUTS, {"latent": latents_of(model)}))


def no_cuda() -> str:
    import onnxruntime

    here = "CUDAExecutionProvider" in onnxruntime.get_available_providers()
    return "" if here else "this ONNX Runtime has no CUDA"


def reference_evaluator(model: Any) -> Any:
    """Return ONNX's own evaluator of a model; its GatherElements can't look up in more than 64 numbers."""
    from onnx.reference import ReferenceEvaluator
    from onnx.reference.op_run import OpRun

    class GatherElements(OpRun):
        def _run(self, data: np.ndarray, indices: np.ndarray, axis: int = 0) -> tuple[np.ndarray]:
            return (np.take_along_axis(data, indices.astype(np.int64), axis),)

    return ReferenceEvaluator(model, new_ops=[GatherElements])


def run_in_reference_evaluator(model: Path) -> Muons:
    return Muons(*reference_evaluator(str(model)).run(OUTPUTS, {"latent": latents_of(model)}))


def run_in_openvino(model: Path) -> Muons:
    import openvino

    # Where a processor has units for bfloat16 or float16, OpenVINO takes them unless told not to.
    compiled = openvino.compile_model(model, "CPU", {"INFERENCE_PRECISION_HINT": "f32"})
    found = compiled({"latent": latents_of(model)})
    return Muons(*(found[name] for name in OUTPUTS))


def run_in_opencv(model: Path) -> Muons:
    import cv2

    network = cv2.dnn.readNetFromONNX(str(model))
    network.setInput(latents_of(model), "latent")
    rate = [RATE] if RATE in network.getUnconnectedOutLayersNames() else []
    return Muons(*network.forward([*OUTPUTS, *rate])[: len(OUTPUTS)])  # all outputs or none


def run_in_tract(model: Path) -> Muons:
    import tract

    runnable = tract.onnx().load(model).into_model().into_runnable()
    found = runnable.run([latents_of(model)])
    return Muons(*(tensor.to_numpy() for tensor in found[: len(OUTPUTS)]))


ENGINES = {
    "ONNX Runtime, CPU": python("onnxruntime", "onnxruntime", run_in_onnxruntime),
    "ONNX Runtime, CUDA": Engine(
        "onnxruntime-gpu",
        partial(version, "onnxruntime-gpu"),
        no_cuda,
        partial(run_in_onnxruntime, provider="CUDAExecutionProvider", use_tf32="0"),
    ),
    "ONNX Runtime in Node.js": javascript("onnxruntime-node"),
    "ONNX Runtime in WebAssembly": javascript("onnxruntime-web"),
    "OpenVINO, CPU": python("openvino", "openvino", run_in_openvino),
    "OpenCV, module dnn": python("opencv-python-headless", "cv2", run_in_opencv),
    "tract": python("tract", "tract", run_in_tract),
    "ONNX's reference evaluator": python("onnx", "onnx", run_in_reference_evaluator),
}
"""By name."""
