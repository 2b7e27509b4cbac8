"""Muons of a GPU, on a processor that stands for one: the kernels are run by tests/support/cuda_emulation.py."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from support import cuda_emulation
from support.analytic_family import analytic_family
from support.ball import Ball
from support.selections import SELECTIONS
from support.tiny_models import RARELY_BAD, tiny_model

from deepmuon_runtime import (
    Box,
    Cuts,
    FailedError,
    Generator,
    Muons,
    Plane,
    RefusedError,
    check_file,
    read_muons,
)
from deepmuon_runtime.cuda import arrivals, device_run, maker, memory
from deepmuon_runtime.model import device, opening
from deepmuon_runtime.sampling import integration, selection

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
    monkeypatch.setattr(maker, "BLOCK", BLOCK)
    monkeypatch.setattr(device_run, "MEMORY", "cpu")
    value_of = onnxruntime.OrtValue.ortvalue_from_numpy
    elsewhere = staticmethod(lambda array, device: value_of(array if device == "cpu" else array.copy(), "cpu"))
    monkeypatch.setattr(onnxruntime.OrtValue, "ortvalue_from_numpy", elsewhere)


@pytest.fixture(autouse=True)
def quick_processor(monkeypatch):
    """Rates are not looked at here, and the processor makes no muons that nobody asks for."""
    monkeypatch.setattr(integration, "FEWEST", 1 << 16)
    monkeypatch.setattr(integration, "PRECISION", {True: 0.01, False: 0.01})
    monkeypatch.setattr(selection, "PIECE", {"cpu": 1 << 14, "cuda": 1 << 14})


@pytest.fixture
def without_cupy(gpu, monkeypatch):
    monkeypatch.setattr(device, "has_cupy", lambda: False)


def of_cpu(model_file, **asked) -> Muons:
    return Generator.open(file=model_file, device="cpu").sample(**asked)


def here(muons: Muons) -> Muons:
    return Muons(**{name: column.get() for name, column in muons.columns.items()}) if are_on_gpu(muons) else muons


def assert_same(found: Muons, expected: Muons) -> None:
    assert found.columns.keys() == expected.columns.keys()
    for name, column in here(found).columns.items():
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


class BallOfNumpy(Ball):
    """The same by an array of numpy's, which does not mix with CuPy's."""

    def path(self, x, y, z, u, v, w):
        found = np.full(len(x), np.nan)
        found[:] = super().path(x, y, z, u, v, w)
        return found


pytestmark = [
    pytest.mark.filterwarnings("ignore:the .* gets the muons of its centre"),
    pytest.mark.filterwarnings("ignore:the cuts keep 1 muon in"),
]


@pytest.fixture(scope="module")
def family(tmp_path_factory) -> Path:
    """A family of both surfaces, of whose latents two make the energy."""
    path = tmp_path_factory.mktemp("family") / "family.onnx"
    path.write_bytes(analytic_family())
    return path


@pytest.fixture
def nothing_copied(monkeypatch):
    """Muons must be made on the GPU: those of the processor find no way there."""
    monkeypatch.setattr(memory, "copied", None)


@pytest.mark.parametrize("asked", SELECTIONS, ids=str)
@pytest.mark.usefixtures("gpu", "nothing_copied")
def test_a_gpu_gives_the_processors_muons_within_cuts_and_on_targets(family, asked):
    generator = Generator.open(file=family)
    expected = of_cpu(family, n=N, seed=3, first=1, **asked)
    found = generator.sample(N, seed=3, first=1, on_device=True, **asked)
    assert are_on_gpu(found)
    assert_same(found, expected)
    assert_same(generator.sample(N, seed=3, first=1, **asked), expected)
    later = generator.sample(N, seed=3, first=2 * BLOCK + 7, on_device=True, **asked)
    assert_same(later[: N - 2 * BLOCK - 6], expected[2 * BLOCK + 6 :])


@pytest.mark.usefixtures("gpu")
def test_the_rate_is_that_of_the_processor(family):
    asked = {"target": Box(4, 4, 3), "cuts": Cuts(zenith_max=80)}
    rates = [Generator.open(file=family, device=device).rate(**asked) for device in ("cpu", "cuda")]
    assert rates[0] == rates[1]


@pytest.mark.parametrize("muons_per_draw", [1, 3, 300])
@pytest.mark.usefixtures("gpu", "nothing_copied")
def test_draws_of_any_number_of_muons_are_made_again_on_a_gpu(tmp_path, muons_per_draw):
    path = tmp_path / "tiny.onnx"
    path.write_bytes(tiny_model(muons_per_draw))
    for asked in ({"cuts": Cuts(energy_min=2)}, {"cuts": Cuts(zenith_max=40), "target": Plane(1, 2)}):
        expected = of_cpu(path, n=N, seed=3, first=1, **asked)
        assert_same(Generator.open(file=path).sample(N, seed=3, first=1, on_device=True, **asked), expected)


@pytest.mark.parametrize(
    "asked",
    [
        {"live_time": 4000.0, "area": 1.0},
        {"live_time": 20.0, "target": Box(4, 4, 3), "cuts": Cuts(energy_min=2, zenith_max=80)},
    ],
    ids=["through slots of time", "with all else"],
)
@pytest.mark.parametrize("on_device", [False, True])
@pytest.mark.usefixtures("gpu", "nothing_copied")
def test_times_of_a_gpu_are_those_of_the_processor_to_the_bit(family, asked, on_device, monkeypatch):
    monkeypatch.setattr(maker, "BLOCK", 1 << 16)
    monkeypatch.setattr(arrivals, "AT_ONCE", 2)
    expected = of_cpu(family, seed=3, **asked)
    found = Generator.open(file=family).sample(seed=3, on_device=on_device, **asked)
    assert are_on_gpu(found) is on_device
    assert_same(found, expected)
    assert np.array_equal(here(found).time, expected.time)


@pytest.mark.usefixtures("gpu")
def test_a_file_of_a_gpu_has_places_and_times_and_is_good(family, tmp_path):
    asked = {"live_time": 20.0, "target": Box(4, 4, 3), "cuts": Cuts(energy_min=2)}
    generator = Generator.open(file=family)
    generator.write(tmp_path / "muons.h5", seed=3, **asked)
    assert check_file(tmp_path / "muons.h5").defects == []
    assert_same(read_muons(tmp_path / "muons.h5"), of_cpu(family, seed=3, **asked))
    with closing(generator.chunks(50 * BLOCK, seed=3, target=Box(4, 4, 3))) as chunks:  # and leave in the middle
        next(chunks)


@pytest.mark.usefixtures("gpu")
def test_a_body_that_takes_no_cupy_arrays_gets_the_processors_muons_and_that_is_said(family):
    body = BallOfNumpy(1.0, 1.3)
    generator = Generator.open(file=family)
    with pytest.warns(UserWarning, match=r"on the BallOfNumpy come from the processor.*CuPy's arrays \(Implicit conv"):
        found = generator.sample(500, seed=3, target=body, on_device=True)
    assert are_on_gpu(found)
    assert_same(found, of_cpu(family, n=500, seed=3, target=body))
    assert_same(generator.sample(500, seed=3, target=body), here(found))


@pytest.mark.usefixtures("gpu")
def test_memory_that_runs_out_in_a_targets_formulas_is_told_in_one_line(family):
    class Large(Ball):
        def path(self, x, y, z, u, v, w):
            if isinstance(x, cuda_emulation.Array) and len(x) > 1000:
                raise cuda_emulation.OutOfMemoryError("no memory for it\nreally")
            return super().path(x, y, z, u, v, w)

    with pytest.raises(FailedError, match=r"the model .* failed on the GPU: no memory for it$"):
        Generator.open(file=family).sample(N, seed=3, target=Large(1.0, 1.3))


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


@pytest.mark.usefixtures("gpu")
def test_a_gpu_has_two_threads_unless_told_otherwise(model_file):
    assert Generator.open(file=model_file, device="cuda").threads == 2
    assert Generator.open(file=model_file, device="cuda", threads=3).threads == 3


def test_muons_of_a_processor_can_not_stay_on_a_gpu(model_file):
    with pytest.raises(RefusedError, match="open the generator on device='cuda'"):
        Generator.open(file=model_file, device="cpu").sample(10, on_device=True)
