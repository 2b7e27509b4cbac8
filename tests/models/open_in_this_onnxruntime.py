"""Runs every released model in whatever ONNX Runtime is there, with nothing but NumPy.

The program beside it runs this one in each release of ONNX Runtime.

    python open_in_this_onnxruntime.py FOLDER
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import onnxruntime

MUONS = 100_000


def check(file: Path, entry: dict[str, str]) -> None:
    """Draw muons from a model and see that they are physical."""
    session = onnxruntime.InferenceSession(file.read_bytes(), providers=["CPUExecutionProvider"])
    assert session.get_modelmeta().custom_metadata_map["deepmuon.contract_version"] == entry["contract_version"]
    latent_size, muons_per_draw = int(entry["latent_size"]), int(entry["muons_per_draw"])
    draws = MUONS // muons_per_draw
    latent = 2 * np.random.default_rng(1).random((draws, latent_size), dtype=np.float32) - 1
    latent[0], latent[1] = -1, 1
    energy, direction, charge = session.run(["kinetic_energy", "direction", "charge"], {"latent": latent})
    muons = draws * muons_per_draw
    assert (energy.shape, direction.shape, charge.shape) == ((muons,), (muons, 3), (muons,))
    assert (energy.dtype, direction.dtype, charge.dtype) == (np.float32, np.float32, np.int8)
    low, high = np.float32(entry["energy_min_gev"]), np.float32(entry["energy_max_gev"])
    assert (energy >= low).all()
    assert (energy <= high).all()
    assert (np.abs(np.linalg.norm(direction.astype(np.float64), axis=1) - 1) < 1e-6).all()
    assert (direction[:, 2] < 0).all()
    assert set(np.unique(charge)) == {-1, 1}


def main(folder: Path) -> None:
    """Check the models of a manifest."""
    entries = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["models"]
    for entry in entries:
        check(folder / entry["file"], entry)
    assert entries
    print(f"{len(entries)} models run in ONNX Runtime {onnxruntime.__version__}, NumPy {np.__version__}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
