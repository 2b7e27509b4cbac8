from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, RefusedError

ENERGY = "kinetic_energy = Exp(log_energy)"


def greedy(count: int, of_each_draw: bool) -> bytes:
    """Return a model that adds up so many zeros, once or for each draw, on the way to its energies."""
    number = "draws = Shape<start = 0, end = 1>(latent)\n many = Mul(draws, count)" if of_each_draw else ""
    added = f"""
        {number}
        zeros = ConstantOfShape({"many" if of_each_draw else "count"})
        nothing = ReduceSum<keepdims = 0>(zeros)
        with_nothing = Add(log_energy, nothing)
        kinetic_energy = Exp(with_nothing)
    """
    return tiny_model(edits={ENERGY: added, "int64 i0 = {0}": f"int64 i0 = {{0}}, int64[1] count = {{{count}}}"})


@pytest.mark.parametrize(("count", "of_each_draw"), [(10**9, False), (12_500, True)], ids=["once", "for each draw"])
def test_a_model_that_asks_for_gigabytes_is_refused_with_their_number_and_does_not_get_them(
    tmp_path, count, of_each_draw
):
    """Four gigabytes, or 3.3 for a block of 65,536 draws."""
    (tmp_path / "greedy.onnx").write_bytes(greedy(count, of_each_draw))
    program = """
        from pathlib import Path
        from deepmuon_runtime import Generator, RefusedError
        try:
            Generator.open(file="greedy.onnx", device="cpu")
        except RefusedError as error:
            print(error)
        status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
        print(status["VmHWM"].split()[0])  # ru_maxrss would count what the tests' own process had when it forked
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        cwd=tmp_path,
        env=os.environ,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    reason, most = done.stdout.splitlines()
    asked = "4" if not of_each_draw else "3.3"
    assert reason.endswith(f"it asks for {asked} GB at once, and should take 1 GB in all at most")
    assert int(most) < 500_000  # kB


def test_a_model_that_asks_for_less_runs_and_gives_the_muons_of_the_frugal_one(tmp_path):
    (tmp_path / "modest.onnx").write_bytes(greedy(10_000_000, of_each_draw=False))
    (tmp_path / "frugal.onnx").write_bytes(tiny_model())
    modest, frugal = (
        Generator.open(file=tmp_path / f"{name}.onnx", device="cpu").sample(1000, seed=1)
        for name in ("modest", "frugal")
    )
    assert np.array_equal(modest.kinetic_energy, frugal.kinetic_energy)


def test_a_named_pipe_or_a_device_is_no_model(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero", tmp_path):
        with pytest.raises(RefusedError, match="it is a folder, a pipe or a device"):
            Generator.open(file=path)


@pytest.mark.parametrize(
    "content",
    [tiny_model(metadata={"depth_m": "1" * 100_000 + "x"}), tiny_model(edits={"latent": "latent" + "x" * 100_000})],
    ids=["metadata", "the name of an input"],
)
def test_long_texts_of_a_model_do_not_fill_the_error(tmp_path, content):
    (tmp_path / "long.onnx").write_bytes(content)
    with pytest.raises(RefusedError, match="breaks the contract") as caught:
        Generator.open(file=tmp_path / "long.onnx")
    assert len(str(caught.value)) < 500
