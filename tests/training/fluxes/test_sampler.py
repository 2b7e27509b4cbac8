"""False-alarm rates: 1e-4 each, at fixed seeds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2, chisquare, kstest

from deepmuon_training.fluxes.ecomug import ecomug
from deepmuon_training.fluxes.flux import Flux
from deepmuon_training.fluxes.gccly import gccly
from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.sampler import PlaneSampler
from deepmuon_training.fluxes.table import read_flux_table

MUONS = 1_000_000
ENERGIES = np.array([1e-3, 0.03, 0.2, 0.5, 1, 2, 4, 8, 15, 30, 100, 1e5])
COSINES = np.array([0, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 1])


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A flux with few lines, and so with kinks."""
    path = tmp_path_factory.mktemp("flux") / "table.csv"
    energy = np.geomspace(1e-3, 1e5, 25)
    lines = [
        f"{e:.10g},{c},{x:.10g},{y:.10g}"
        for c in (0.0, 0.1, 0.4, 0.7, 1.0)
        for e, x, y in zip(energy, *MEASURED.intensity(energy, np.array(c)), strict=True)
    ]
    path.write_text("\n".join(lines))
    return read_flux_table(path)


def rates(flux):
    """Of mu+ and mu- in cells [charge, energy, cosine], by a rule of Gauss and Legendre in 16 parts of each cell."""
    nodes, weights = np.polynomial.legendre.leggauss(8)

    def points(edges):
        fine = np.concatenate(
            [np.linspace(low, high, 16, endpoint=False) for low, high in pairwise(edges)] + [edges[-1:]]
        )
        half = np.diff(fine)[:, None] / 2
        return (fine[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()

    log_energy, energy_weight = points(np.log(ENERGIES))
    cosine, cosine_weight = points(COSINES)
    energy = np.exp(log_energy)[:, None]
    cells = np.array(flux.intensity(energy, cosine)) * energy * cosine * energy_weight[:, None] * cosine_weight
    shape = (2, len(ENERGIES) - 1, 16 * 8, len(COSINES) - 1, 16 * 8)
    return cells.reshape(shape).sum(axis=(2, 4))


@pytest.mark.parametrize("name", ["measured", "gccly", "ecomug", "table"])
def test_muons_of_each_charge_energy_and_angle_are_as_many_as_numerical_integration_says(name, table):
    flux = {"measured": MEASURED, "gccly": gccly(), "ecomug": ecomug(), "table": table}[name]
    muons = PlaneSampler(flux, ENERGIES[0], ENERGIES[-1]).draw(MUONS, 7)
    found = np.array(
        [
            np.histogram2d(muons.kinetic_energy[of], muons.cos_zenith[of], (ENERGIES, COSINES))[0]
            for of in (muons.charge > 0, muons.charge < 0)
        ]
    )
    assert found.sum() == MUONS
    expected = rates(flux)
    expected *= MUONS / expected.sum()
    many = expected > 10
    rest = ~many
    found = np.append(found[many], found[rest].sum())
    expected = np.append(expected[many], expected[rest].sum())
    assert chisquare(found, expected).pvalue > 1e-4


def test_a_power_law_is_drawn_exactly():
    law = Flux("law", "", lambda energy, cosine: (energy**-3.0 * cosine**1.5, 0.5 * energy**-3.0 * cosine**1.5))
    muons = PlaneSampler(law, 2.0, 50.0).draw(MUONS, 8)
    low, high = 2.0**-2, 50.0**-2
    assert kstest(muons.kinetic_energy.astype(float), lambda e: (low - e**-2.0) / (low - high)).pvalue > 1e-4
    assert kstest(muons.cos_zenith.astype(float), lambda c: c**3.5).pvalue > 1e-4
    positive = (muons.charge > 0).sum()
    assert (positive - MUONS * 2 / 3) ** 2 / (MUONS * 2 / 9) < chi2.isf(1e-4, 1)


def test_energy_and_angle_and_azimuth_stay_in_their_ranges_down_to_the_horizon():
    muons = PlaneSampler(MEASURED, 0.5, 0.6).draw(MUONS, 9)
    assert muons.kinetic_energy.min() >= np.float32(0.5)
    assert muons.kinetic_energy.max() <= np.float32(0.6)
    assert muons.w.max() < 0
    azimuth = np.arctan2(muons.v, muons.u)
    assert kstest(azimuth.astype(float), lambda a: (a + np.pi) / (2 * np.pi)).pvalue > 1e-4


def test_a_seed_gives_the_same_muons_again():
    sampler = PlaneSampler(gccly(), 1.0, 1e5)
    np.testing.assert_array_equal(sampler.draw(100, 5).kinetic_energy, sampler.draw(100, 5).kinetic_energy)
    assert (sampler.draw(100, 5).kinetic_energy != sampler.draw(100, 6).kinetic_energy).all()
