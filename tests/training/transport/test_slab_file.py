from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_training.sample import Sample, read_sample, write_sample
from deepmuon_training.transport import slab_file as module
from deepmuon_training.transport.slab import Transported, transport
from deepmuon_training.transport.slab_file import transport_file

MUONS, PER_PART = 5000, 2000


class KilledError(Exception):
    pass


@pytest.fixture
def upper(tmp_path: Path) -> Path:
    """Muons of 0.2 to 2 GeV, some half of which cross 3 m of water."""
    random = np.random.default_rng(1)
    w = -np.sqrt(random.uniform(0.1, 1, MUONS))
    pdg_id = random.choice([MU_MINUS, MU_PLUS], MUONS)
    muons = Muons.of(random.uniform(0.2, 2, MUONS), np.sqrt(1 - w**2), np.zeros(MUONS), w, pdg_id)
    path = tmp_path / "upper.h5"
    write_sample(path, Sample(muons, 0.0, "test", ("made",), rate=100.0, rate_uncertainty=1.0, smoothed=True))
    return path


def carry(upper: Path, name: str) -> Sample:
    target, folder = upper.with_name(f"{name}.h5"), upper.with_name(name)
    folder.mkdir(exist_ok=True)
    transport_file(upper, target, 3.0, seed=1, muons_per_part=PER_PART, folder=folder, progress=False)
    return read_sample(target)


def assert_same(found: Sample, expected: Sample) -> None:
    for field in fields(Sample):
        if field.name != "muons":
            assert getattr(found, field.name) == getattr(expected, field.name), field.name
    for field in fields(Muons):
        np.testing.assert_array_equal(getattr(found.muons, field.name), getattr(expected.muons, field.name))


def test_damaged_muons_are_refused_before_any_is_carried(upper: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(module, "transport")
    with h5py.File(upper, "r+") as file:
        file["muons/kinetic_energy"][-1] *= 2
    with pytest.raises(RefusedError, match="is damaged: the column kinetic_energy is not what was written"):
        carry(upper, "lower")


def test_the_survivors_are_those_of_the_parts_each_with_its_own_seed(upper: Path) -> None:
    found = carry(upper, "lower")
    seeds = [int(np.random.SeedSequence(1, spawn_key=(part,)).generate_state(1)[0]) for part in range(3)]
    samples = [read_sample(upper, first, number) for first, number in ((0, 2000), (2000, 2000), (4000, 1000))]
    parts = [
        transport(sample, 3.0, seed=seed, progress=False).sample for sample, seed in zip(samples, seeds, strict=True)
    ]
    expected = Muons.concatenate([part.muons for part in parts])
    fraction = len(expected) / MUONS
    assert 0.2 < fraction < 0.8
    assert found.rate == pytest.approx(100 * fraction)
    binomial = np.sqrt(fraction * (1 - fraction) / MUONS)  # which the exact interval is a little wider than
    assert found.rate_uncertainty == pytest.approx(np.hypot(fraction, 100 * binomial), rel=0.02)
    assert (found.depth_m, found.source, found.smoothed) == (3.0, "test", True)
    assert found.provenance[0] == "made"
    assert f"seed 1, in parts of 2000: {len(expected)} of 5000 survived" in found.provenance[1]
    for field in fields(Muons):
        np.testing.assert_array_equal(getattr(found.muons, field.name), getattr(expected, field.name))


def test_an_interrupted_transport_carries_only_the_missing_parts_and_ends_with_the_same_survivors(
    upper: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = 0

    def dying_once(*arguments: Any, **options: Any) -> Transported:
        nonlocal calls
        calls += 1
        if calls == 2:
            raise KilledError
        return transport(*arguments, **options)

    undisturbed = carry(upper, "undisturbed")
    monkeypatch.setattr(module, "transport", dying_once)
    with pytest.raises(KilledError):
        carry(upper, "lower")
    assert_same(carry(upper, "lower"), undisturbed)
    assert calls == 4  # one of the first run, the interrupted one, two of the second


def test_a_transport_that_nothing_survives_is_an_error(upper: Path) -> None:
    with pytest.raises(FailedError, match="none of 5,000 muons survived 100 m of G4_WATER"):
        transport_file(
            upper,
            upper.with_name("lower.h5"),
            100.0,
            seed=1,
            muons_per_part=10_000,
            folder=upper.parent,
            progress=False,
        )
    assert not upper.with_name("lower.h5").exists()
