"""Muons of a GPU, on a processor that stands for one: the kernels are run by tests/support/cuda_emulation.py."""

from __future__ import annotations

import sys

import numpy as np
import onnxruntime
import pytest
from support import cuda_emulation
from support.tiny_models import RARELY_BAD, tiny_model

from deepmuon_runtime import Cuts, FailedError, Generator, Muons, Plane, RefusedError, read_muons
from deepmuon_runtime.cuda import blocks, device_run
from deepmuon_runtime.model import device, opening

N = 3000  # several blocks, and a part of one
BLOCK = 1 << 10


@pytest.fixture
def gpu(monkeypatch):
    """A machine with a GPU, onnxruntime-gpu and CuPy."""
    on_cpu = opening.open_session

    def on_gpu(content, name, asked):
        return on_cpu(content, name, "cpu")[0], "cpu" if asked == "cpu" else "cuda"

    monkeypatch.setattr(opening, "open_session", on_gpu)
    for name, module in cuda_emulation.modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(device, "has_cupy", lambda: True)
    monkeypatch.setattr(blocks, "BLOCK", BLOCK)
    monkeypatch.setattr(device_run, "MEMORY", "cpu")
    value_of = onnxruntime.OrtValue.ortvalue_from_numpy
    elsewhere = staticmethod(lambda array, device: value_of(array if device == "cpu" else array.copy(), "cpu"))
    monkeypatch.setattr(onnxruntime.OrtValue, "ortvalue_from_numpy", elsewhere)


@pytest.fixture
def without_cupy(gpu, monkeypatch):
    monkeypatch.setattr(device, "has_cupy", lambda: False)


def of_cpu(model_file, **asked) -> Muons:
    return Generator.open(file=model_file, device="cpu").sample(**asked)


def assert_same(found: Muons, expected: Muons) -> None:
    assert found.columns.keys() == expected.columns.keys()
    for name, column in found.columns.items():
        assert column.dtype == expected.columns[name].dtype
        np.testing.assert_allclose(column, expected.columns[name], rtol=1e-5, atol=1e-6)


def are_on_gpu(muons: Muons) -> bool:
    return all(isinstance(column, cuda_emulation.Array) for column in muons.columns.values())


@pytest.mark.parametrize("first", [0, 1, BLOCK - 1, 5 * BLOCK + 7])
@pytest.mark.parametrize("on_device", [False, True])
@pytest.mark.usefixtures("gpu")
def test_a_gpu_gives_the_muons_of_the_processor_from_any_number_on(model_file, first, on_device):
    expected = of_cpu(model_file, n=N, seed=3, first=first)
    found = Generator.open(file=model_file).sample(N, seed=3, first=first, on_device=on_device)
    assert are_on_gpu(found) is on_device
    assert_same(found, expected)


@pytest.mark.usefixtures("gpu")
def test_a_model_of_several_muons_a_draw_is_cut_into_columns_too(tmp_path):
    path = tmp_path / "three.onnx"
    path.write_bytes(tiny_model(muons_per_draw=3))
    expected = of_cpu(path, n=N, seed=3, first=1)
    assert_same(Generator.open(file=path).sample(N, seed=3, first=1, on_device=True), expected)


@pytest.mark.usefixtures("gpu")
def test_a_file_and_chunks_come_from_the_gpu(model_file, tmp_path):
    generator = Generator.open(file=model_file)
    generator.write(tmp_path / "muons.h5", N, seed=3)
    whole = generator.sample(N, seed=3)
    assert_same(read_muons(tmp_path / "muons.h5"), whole)
    assert_same(Muons.concatenate(list(generator.chunks(N, seed=3))), whole)
    assert generator.sample(0, on_device=True).kinetic_energy.shape == (0,)


@pytest.mark.parametrize(
    "asked",
    [
        {"n": 500, "cuts": Cuts(energy_min=0.5)},
        {"n": 500, "target": Plane(2, 3)},
        {"live_time": 10.0, "area": 4.0},
    ],
    ids=["cuts", "target", "live time"],
)
@pytest.mark.usefixtures("gpu")
def test_what_the_processor_decides_is_copied_to_the_gpu(model_file, asked):
    expected = of_cpu(model_file, seed=3, **asked)
    found = Generator.open(file=model_file).sample(seed=3, on_device=True, **asked)
    assert are_on_gpu(found)
    assert_same(found, expected)


@pytest.mark.parametrize("on_device", [False, True])
@pytest.mark.usefixtures("gpu")
def test_a_bad_muon_is_named_as_the_processor_names_it(tmp_path, on_device):
    path = tmp_path / "rarely_bad.onnx"
    path.write_bytes(tiny_model(edits=RARELY_BAD))
    with pytest.raises(FailedError, match="bad muon") as of_processor:
        of_cpu(path, n=1_000_000, seed=3)
    number = int(str(of_processor.value).split("number ")[1].split()[0])
    with pytest.raises(FailedError, match="bad muon") as of_gpu:
        Generator.open(file=path).sample(200, seed=3, first=number - 50, on_device=on_device)
    assert str(of_gpu.value).split("(")[0] == str(of_processor.value).split("(")[0]


@pytest.mark.usefixtures("gpu")
def test_more_than_a_gpu_holds_is_refused(model_file, monkeypatch):
    def full(*_: object) -> None:
        raise cuda_emulation.OutOfMemoryError

    generator = Generator.open(file=model_file)
    generator.sample(10, on_device=True)
    monkeypatch.setattr(sys.modules["cupy"], "empty", full)
    with pytest.raises(RefusedError, match="10 muons do not fit in the GPU's memory"):
        generator.sample(10, on_device=True)


@pytest.mark.usefixtures("without_cupy")
def test_without_cupy_muons_come_with_a_hint_and_stay_in_the_computers_memory(model_file):
    generator = Generator.open(file=model_file, device="cuda")
    n = 300_000  # more than a block
    with pytest.warns(UserWarning, match=r"pip install 'deepmuon-runtime\[cuda\]'"):
        muons = generator.sample(n, seed=3)
    assert not are_on_gpu(muons)
    assert_same(muons, of_cpu(model_file, n=n, seed=3))
    with pytest.raises(RefusedError, match=r"CuPy's arrays: pip install 'deepmuon-runtime\[cuda\]'"):
        generator.sample(10, seed=3, on_device=True)


@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize(("architecture", "taken"), [("quantile", "cpu"), ("transformer", "cuda")])
def test_auto_is_the_processor_for_quantile_without_cupy(monkeypatch, architecture, taken):
    assert Generator.open(10, architecture).device == "cuda"
    monkeypatch.setattr(device, "has_cupy", lambda: False)
    assert Generator.open(10, architecture).device == taken
    assert Generator.open(10, architecture, device="cuda").device == "cuda"


def test_muons_of_a_processor_can_not_stay_on_a_gpu(model_file):
    with pytest.raises(RefusedError, match="open the generator on device='cuda'"):
        Generator.open(file=model_file, device="cpu").sample(10, on_device=True)
