"""What a run takes of the machine's memory, whatever its length."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from support.tiny_models import tiny_model

from deepmuon_runtime.model.metadata import LARGEST_DRAW, LATENTS_PER_MUON

# A process that is large itself, as this one may be, would pass its own peak on to its child.
PEAK_OF_A_COMMAND = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * (1 if sys.platform == "darwin" else 1024))
"""


def peak_memory(folder: Path, *arguments: object) -> int:
    """Return the largest memory of a deepmuon-gen, in bytes."""
    gen = [sys.executable, "-m", "deepmuon_cli.gen", *map(str, arguments), "--quiet", "-o", str(folder / "muons.h5")]
    done = subprocess.run([sys.executable, "-c", PEAK_OF_A_COMMAND, *gen], capture_output=True, text=True, check=True)
    return int(done.stdout)


@pytest.mark.parametrize("threads", [2, 16])
def test_many_muons_need_less_than_300_mb(tmp_path, threads):
    assert 3e7 < peak_memory(tmp_path, "--depth", 0, "-n", "1e7", "--threads", threads) < 3e8


def test_draws_of_the_most_muons_need_less_than_300_mb_on_two_threads(tmp_path):
    model = tmp_path / "large.onnx"
    model.write_bytes(tiny_model(LARGEST_DRAW))
    assert 3e7 < peak_memory(tmp_path, "--model", model, "-n", "2e6", "--threads", 2) < 3e8


def test_draws_of_the_most_latents_need_less_than_300_mb_on_two_threads(tmp_path):
    """Each muon is made of the first 4 of its latents."""
    size = LARGEST_DRAW * LATENTS_PER_MUON
    edits = {
        "float[draws, 4] latent": f"float[draws, {size}] latent",
        "int64[1] last": "int64[1] start = {0}, int64[1] four = {4}, int64[1] last",
        "clipped = Clip(latent": "few = Slice(latent, start, four, last)\n    clipped = Clip(few",
    }
    model = tmp_path / "large.onnx"
    model.write_bytes(tiny_model(metadata={"latent_size": str(size)}, edits=edits))
    assert 3e7 < peak_memory(tmp_path, "--model", model, "-n", 50, "--threads", 2) < 3e8
