from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import deepmuon_runtime.views.spectra
from deepmuon_runtime import Muons, write_muons
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.views.spectra import ENERGY_EDGES, ZENITH_EDGES, Spectra, count_spectra

ZENITH = np.radians([1.0, 59.9, 60.1, 89.9])
MUONS = Muons.of([1.1, 1.1, 90.0, 0.0011], np.sin(ZENITH), np.zeros(4), -np.cos(ZENITH), [13, 13, -13, 13])


@pytest.fixture
def write(tmp_path):
    def run(muons: Muons, **known: float) -> Path:
        write_muons(tmp_path / "muons.h5", muons, {"depth_m": 10.0, "medium": "G4_WATER", **known})
        return tmp_path / "muons.h5"

    return run


@pytest.mark.parametrize("piece", [1, 3, 100])
def test_muons_are_counted_in_their_bins(write, monkeypatch, piece):
    monkeypatch.setattr(deepmuon_runtime.views.spectra, "PIECE", piece)
    seen: list[int] = []
    spectra = count_spectra(write(MUONS, rate_hz_per_m2=50.0), progress=seen.append)
    assert (spectra.name, spectra.depth_m, spectra.count, spectra.rate) == ("muons.h5", 10.0, 4, 50.0)
    assert sum(seen) == 4
    at = {edge: int(count) for edge, count in zip(ENERGY_EDGES.round(4), spectra.by_energy, strict=False) if count}
    assert at == {0.001: 1, 1.0: 2, 79.4328: 1}
    at = {edge: int(count) for edge, count in zip(ZENITH_EDGES, spectra.by_zenith, strict=False) if count}
    assert at == {0: 1, 58: 1, 60: 1, 88: 1}


def test_a_file_without_a_muon_is_refused(write):
    with pytest.raises(RefusedError, match="holds no muon"):
        count_spectra(write(Muons.empty(0)))


def test_curves_are_rates_only_where_all_files_know_theirs(write):
    plot = pytest.importorskip("deepmuon_runtime.views.plot")
    known, unknown = count_spectra(write(MUONS, rate_hz_per_m2=50.0)), None
    unknown = Spectra(known.name, known.depth_m, known.count, None, known.by_energy, known.by_zenith)

    def drawn(*spectra: Spectra) -> tuple[str, list[float]]:
        energy, zenith = plot.draw_spectra(spectra).axes
        assert len(zenith.get_legend().get_texts()) == len(spectra)
        totals = [np.nansum(stairs.get_data().values * np.diff(stairs.get_data().edges)) for stairs in zenith.patches]
        return energy.get_ylabel(), totals

    assert drawn(known, known) == ("muons / (m² s) per unit of ln E", pytest.approx([50.0, 50.0]))
    assert drawn(known, unknown) == ("share of the muons per unit of ln E", pytest.approx([1.0, 1.0]))
