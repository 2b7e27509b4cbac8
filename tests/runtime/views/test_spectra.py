from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import deepmuon_runtime.views.spectra
from deepmuon_runtime import Muons, write_muons
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.views.spectra import COS_ZENITH_EDGES, ENERGY_EDGES, Spectra, count_spectra

ZENITH = np.radians([1.0, 59.9, 60.1, 89.9])
MUONS = Muons.of([1.1, 1.1, 90.0, 0.0011], np.sin(ZENITH), np.zeros(4), -np.cos(ZENITH), [13, 13, -13, 13])


@pytest.fixture
def write(tmp_path):
    def run(muons: Muons, **known: object) -> Path:
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
    at = {
        edge: int(count) for edge, count in zip(COS_ZENITH_EDGES.round(2), spectra.by_cos_zenith, strict=False) if count
    }
    assert at == {0.95: 1, 0.5: 1, 0.45: 1, 0: 1}


def test_the_rate_of_a_sphere_is_none_of_a_horizontal_plane(write):
    assert count_spectra(write(MUONS, rate_hz_per_m2=50.0, surface=1)).rate is None


def test_a_file_without_a_muon_is_refused(write):
    with pytest.raises(RefusedError, match="holds no muon"):
        count_spectra(write(Muons.empty(0)))


def test_curves_are_rates_only_where_all_files_know_theirs(write):
    plot = pytest.importorskip("deepmuon_runtime.views.plot")
    known, unknown = count_spectra(write(MUONS, rate_hz_per_m2=50.0)), None
    unknown = replace(known, rate=None)

    def drawn(*spectra: Spectra) -> tuple[str, list[float]]:
        figure = plot.draw_spectra(spectra)
        energy, zenith = figure.axes
        assert len(figure.legends[0].get_texts()) == len(spectra)
        curves = [stairs.get_data() for stairs in zenith.patches if stairs.get_label().startswith("muons.h5")]
        totals = [np.nansum(curve.values * np.diff(curve.edges)) for curve in curves]
        return energy.get_ylabel(), totals

    assert drawn(known, known) == ("$E$ dΦ/d$E$  /  m$^{-2}$ s$^{-1}$", pytest.approx([50.0, 50.0]))
    assert drawn(known, unknown) == ("share of the muons per unit of ln $E$", pytest.approx([1.0, 1.0]))


def test_bands_are_one_standard_deviation_of_the_counts(write):
    plot = pytest.importorskip("deepmuon_runtime.views.plot")
    many = Muons.concatenate([MUONS[:1]] * 25)
    _, zenith = plot.draw_spectra([count_spectra(write(many, rate_hz_per_m2=50.0))]).axes
    (band,) = [stairs.get_data() for stairs in zenith.patches if stairs.get_fill()]
    np.testing.assert_allclose([band.baseline[0], band.values[0]], 50 / 0.05 * np.array([20, 30]) / 25)


def test_the_legend_says_depth_and_medium_and_the_flux_where_that_is_known(write):
    plot = pytest.importorskip("deepmuon_runtime.views.plot")
    known = count_spectra(write(MUONS, medium="rock", flux="measured"))
    figure = plot.draw_spectra([known, replace(known, flux=None)])
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == [
        "muons.h5: 4 muons under 10 m of rock, flux measured",
        "muons.h5: 4 muons under 10 m of rock",
    ]


def test_the_legend_lies_outside_of_the_curves(write):
    plot = pytest.importorskip("deepmuon_runtime.views.plot")
    figure = plot.draw_spectra([count_spectra(write(MUONS))] * 4)
    figure.draw_without_rendering()
    legend = figure.legends[0].get_window_extent()
    assert not any(legend.overlaps(axes.get_window_extent()) for axes in figure.axes)
    assert legend.x1 <= figure.bbox.x1


@pytest.mark.parametrize(
    ("depth", "medium", "words"),
    [
        (0, "G4_WATER", "at sea level"),
        (10, "G4_WATER", "under 10 m of water"),
        (2.5, "standard_rock, 2.71 g/cm3", "under 2.5 m of standard_rock, 2.71 g/cm3"),
    ],
)
def test_a_plane_is_named_in_words(depth, medium, words):
    plot = pytest.importorskip("deepmuon_runtime.views.plot")
    assert plot.place(depth, medium) == words
