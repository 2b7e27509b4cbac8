"""Geant4 carries muons here: expected values are for real transport, with their statistical tolerance."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_training.sample import Sample
from deepmuon_training.transport import slab as transport_module
from deepmuon_training.transport.slab import Transported, below_slab, transport


def sample_of(
    energy: NDArray[np.floating] | float,
    cos_zenith: NDArray[np.floating] | float = 1.0,
    azimuth: NDArray[np.floating] | float = 0.0,
    pdg_id: NDArray[np.integer] | int = MU_MINUS,
    n: int = 1,
) -> Sample:
    """Return a sea-level sample of n muons, whose rate is 100 +- 2."""
    columns = [np.broadcast_to(column, n) for column in (energy, cos_zenith, azimuth)]
    energies, cosines, azimuths = (column.astype(np.float64) for column in columns)
    sines = np.sqrt(1 - cosines**2)
    direction = (sines * np.cos(azimuths), sines * np.sin(azimuths), -cosines)
    kinetic_energy, u, v, w = (column.astype(np.float32) for column in (energies, *direction))
    muons = Muons(kinetic_energy, u, v, w, np.broadcast_to(pdg_id, n).astype(np.int8))
    return Sample(muons, depth_m=0.0, source="test", rate=100.0, rate_uncertainty=2.0, smoothed=True)


def power_law_sample(n: int, lowest_energy: float, seed: int) -> Sample:
    """Return muons of both charges with an E^-2.7 spectrum from all over the sky."""
    random = np.random.default_rng(seed)
    energy = lowest_energy * (1 - random.random(n)) ** (-1 / 1.7)
    cos_zenith = np.sqrt(random.uniform(0.01, 1, n))
    pdg_id = random.choice([MU_MINUS, MU_PLUS], n)
    return sample_of(energy, cos_zenith, random.uniform(-np.pi, np.pi, n), pdg_id, n)


def assert_same(first: Muons, second: Muons) -> None:
    for column in first.columns:
        np.testing.assert_array_equal(getattr(first, column), getattr(second, column))


@pytest.fixture(scope="module")
def vertical() -> Transported:
    """40,000 vertical muons of 10 GeV, half of each charge, under 10 m of water."""
    pdg_id = np.resize([MU_MINUS, MU_PLUS], 40_000)
    return transport(sample_of(10.0, pdg_id=pdg_id, n=40_000), 10.0, seed=1, progress=False)


def test_a_10_gev_muon_has_7_52_gev_left_under_10_m_of_water(vertical: Transported) -> None:
    # 7.520 +- 0.001 GeV was found with steps of 0.3 % of the range, and 7.521 +- 0.005 with a production cut
    # of 1 mm. Tolerance: 4 standard errors of the mean and 0.005 for that; one false alarm in 16,000 seeds.
    energy = vertical.sample.muons.kinetic_energy.astype(np.float64)
    assert energy.mean() == pytest.approx(7.52, abs=4 * energy.std() / math.sqrt(len(energy)) + 0.005)


def test_a_10_gev_muon_is_scattered_by_8_5_mrad_in_10_m_of_water(vertical: Transported) -> None:
    # The half width that holds 68.27 % of the angles in a plane, which no rare hard scattering moves: 8.54 +-
    # 0.03 mrad was found with steps of 0.3 % of the range, 8.53 +- 0.04 with a production cut of 1 mm.
    # Tolerance: 0.08 for that, and 4 times the half width's own error (0.4 %), one false alarm in 16,000;
    # the steps that Geant4 takes by itself give 8.27.
    muons = vertical.sample.muons
    angles = np.arctan2(np.concatenate([muons.u, muons.v]), np.tile(-muons.w, 2))
    assert np.quantile(np.abs(angles), 0.6827) * 1e3 == pytest.approx(8.54, abs=0.08 + 4 * 0.004 * 8.54)


def test_scattering_has_no_preferred_azimuth(vertical: Transported) -> None:
    # n |mean of exp(i k azimuth)|^2 is exponential with mean 1: one of four is over 11 once in 15,000 seeds.
    azimuth = np.arctan2(vertical.sample.muons.v, vertical.sample.muons.u)
    harmonics = [abs(np.mean(np.exp(1j * k * azimuth))) ** 2 * len(azimuth) for k in (1, 2, 3, 4)]
    assert max(harmonics) < 11


def test_every_muon_is_accounted_for() -> None:
    found = transport(power_law_sample(30_000, 1.0, seed=5), 10.0, seed=2, progress=False)
    lost = found.screened + found.stopped + found.upward + found.below_minimum
    assert found.started == 30_000 == len(found.sample) + lost
    assert min(found.screened, found.stopped, len(found.sample)) > 1000


def test_survivors_go_down_with_unit_direction_and_at_least_1_mev() -> None:
    muons = transport(power_law_sample(20_000, 1.0, seed=6), 5.0, seed=3, progress=False).sample.muons
    assert np.all(muons.w < 0)
    assert np.all(muons.kinetic_energy >= np.float32(1e-3))
    np.testing.assert_allclose(np.sqrt(muons.u**2 + muons.v**2 + muons.w**2), 1, atol=1e-6)


def test_muons_with_less_than_1_mev_and_those_scattered_back_are_counted_and_dropped() -> None:
    # Slanting muons of 2 to 20 MeV, whose range is some mm: scattering turns a few of them around.
    random = np.random.default_rng(7)
    before = sample_of(random.uniform(0.002, 0.02, 20_000), random.uniform(0.01, 0.3, 20_000), n=20_000)
    found = transport(before, 0.002, seed=4, progress=False)
    assert found.upward > 0
    assert found.below_minimum > 0
    assert np.all(found.sample.muons.w < 0)
    assert np.all(found.sample.muons.kinetic_energy >= np.float32(1e-3))


def test_each_muon_keeps_its_charge_and_its_place() -> None:
    # Negative muons enter with 8 GeV and positive ones with 400, in turn: 10 m cost the latter 4 GeV.
    pdg_id = np.resize([MU_MINUS, MU_PLUS], 1000)
    before = sample_of(np.where(pdg_id == MU_MINUS, 8.0, 400.0), pdg_id=pdg_id, n=1000)
    found = transport(before, 10.0, seed=5, progress=False)
    after = found.sample.muons
    assert len(after) > 990
    np.testing.assert_array_equal(after.pdg_id == MU_MINUS, after.kinetic_energy < 8)


def test_survivors_of_a_seed_do_not_depend_on_the_number_of_processes() -> None:
    before = power_law_sample(45_000, 5.0, seed=8)  # more chunks than processes
    alone, shared = (transport(before, 1.0, seed=6, processes=k, progress=False).sample for k in (1, 2))
    assert_same(alone.muons, shared.muons)


def test_another_seed_gives_other_survivors_of_the_same_distribution() -> None:
    # Kolmogorov-Smirnov p below 1e-4: one false alarm in 10,000.
    before = power_law_sample(10_000, 5.0, seed=9)
    first, second = (transport(before, 5.0, seed=k, progress=False).sample.muons for k in (7, 8))
    assert not np.array_equal(first.kinetic_energy[:100], second.kinetic_energy[:100])
    assert stats.ks_2samp(first.kinetic_energy, second.kinetic_energy).pvalue > 1e-4


def test_five_slabs_of_10_m_are_one_of_50_m() -> None:
    # The same primaries, so the difference of the counts varies less than that of two binomial numbers: it
    # exceeds 4 of their standard deviations (5 %) less than once in 16,000 seeds, the KS tests fail less than
    # once in 5000.
    before = power_law_sample(20_000, 10.0, seed=10)
    once = transport(before, 50.0, seed=9, progress=False).sample
    layered = before
    for seed in range(10, 15):
        layered = transport(layered, 10.0, seed=seed, progress=False).sample
    fraction = len(once) / len(before)
    sigma = math.sqrt(2 * len(before) * fraction * (1 - fraction))
    assert abs(len(layered) - len(once)) < 4 * sigma
    assert layered.depth_m == pytest.approx(once.depth_m)
    assert stats.ks_2samp(layered.muons.kinetic_energy, once.muons.kinetic_energy).pvalue > 1e-4
    assert stats.ks_2samp(layered.muons.w, once.muons.w).pvalue > 1e-4


def test_muons_that_are_left_out_beforehand_would_not_have_arrived(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(11)
    cos_zenith = np.sqrt(random.uniform(0.01, 1, 10_000))
    hopeless = sample_of(10 * random.uniform(0.16, 0.1799, 10_000) / cos_zenith, cos_zenith, n=10_000)
    assert transport(hopeless, 10.0, seed=15, progress=False).screened == 10_000
    monkeypatch.setattr(transport_module, "_LEAST_LOSS", 0.0)
    tried = transport(hopeless, 10.0, seed=15, progress=False)
    assert tried.screened == 0
    assert len(tried.sample) <= 2  # a grazing one can be scattered down


def test_a_sample_of_which_nothing_arrives_ends_empty() -> None:
    found = transport(sample_of(0.5, n=10), 10.0, seed=1, progress=False)
    assert (len(found.sample), found.screened) == (0, 10)
    assert (found.surviving_fraction, found.sample.rate) == (0, 0)
    assert found.surviving_fraction_interval == (0, pytest.approx(1 - 0.15865**0.1))


def test_a_sample_of_which_all_arrives_leaves_open_whether_all_do() -> None:
    found = transport(sample_of(100.0, n=20), 0.01, seed=1, progress=False)
    assert found.surviving_fraction == 1
    assert found.surviving_fraction_interval == (pytest.approx(0.15865 ** (1 / 20)), 1)
    assert found.sample.rate_uncertainty > 0


def clopper_pearson(survived: int, started: int) -> tuple[float, float]:
    """The interval in the words of beta functions: which fractions have 15.865 % on each side."""
    low = stats.beta.ppf(0.15865, survived, started - survived + 1)
    return float(low), float(stats.beta.ppf(1 - 0.15865, survived + 1, started - survived))


def test_the_survivors_carry_rate_depth_and_provenance() -> None:
    before = power_law_sample(5000, 1.0, seed=12)
    found = transport(before, 4.0, seed=16, progress=False)
    after, fraction = found.sample, len(found.sample) / 5000
    low, high = clopper_pearson(len(after), 5000)
    error = (high - low) / 2
    assert error == pytest.approx(math.sqrt(fraction * (1 - fraction) / 5000), rel=0.03)
    assert (after.depth_m, after.medium, after.smoothed, after.source) == (4.0, "G4_WATER", True, "test")
    assert found.surviving_fraction == fraction
    assert found.surviving_fraction_interval == pytest.approx((low, high))
    assert found.surviving_fraction_error == pytest.approx(error)
    assert after.rate == pytest.approx(100 * fraction)
    assert after.rate_uncertainty == pytest.approx(100 * fraction * math.hypot(2 / 100, error / fraction))
    assert "4 m of G4_WATER" in after.provenance[-1]
    assert "seed 16" in after.provenance[-1]


def test_the_error_of_a_slab_is_kept_where_that_of_the_rate_above_is_unknown() -> None:
    above = replace(sample_of(10.0), rate_uncertainty=None)
    below = below_slab(above, 1000, 400, 10.0, "G4_WATER", "seed 1")
    assert below.rate == pytest.approx(40)
    low, high = clopper_pearson(400, 1000)
    assert below.rate_uncertainty == pytest.approx(100 * (high - low) / 2, rel=1e-4)


def test_an_unknown_rate_stays_unknown() -> None:
    muons = sample_of(10.0, n=100).muons
    after = transport(Sample(muons, 0.0, "test"), 1.0, seed=1, progress=False).sample
    assert (after.rate, after.rate_uncertainty) == (None, None)


def test_denser_material_stops_more() -> None:
    before = power_law_sample(2000, 1.0, seed=13)
    water, concrete = (
        transport(before, 5.0, seed=17, material=material, progress=False) for material in ("G4_WATER", "G4_CONCRETE")
    )
    assert len(concrete.sample) < 0.8 * len(water.sample)
    assert concrete.sample.medium == "G4_CONCRETE"
    assert concrete.screened == 0


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [
        ("kinetic_energy", np.nan, "muon 2 has a kinetic energy outside"),
        ("kinetic_energy", np.inf, "muon 2 has a kinetic energy outside"),
        ("kinetic_energy", 0, "muon 2 has a kinetic energy outside"),
        ("kinetic_energy", -1, "muon 2 has a kinetic energy outside"),
        ("kinetic_energy", 2e5, "muon 2 has a kinetic energy outside"),
        ("w", 1, "muon 2 does not go down"),
        ("w", -0.5, "muon 2 has a direction whose length is not 1"),
        ("u", np.nan, "muon 2 has a direction whose length is not 1"),
        ("pdg_id", 11, r"muon 2 has a charge other than -1 and \+1"),
    ],
)
def test_a_muon_that_cannot_be_carried_is_refused_by_its_row(column: str, value: float, complaint: str) -> None:
    sample = sample_of(10.0, n=4)
    getattr(sample.muons, column)[2] = value
    with pytest.raises(RefusedError, match=complaint) as refusal:
        transport(sample, 10.0, seed=1, progress=False)
    assert "\n" not in str(refusal.value)


def test_an_empty_sample_is_refused() -> None:
    with pytest.raises(RefusedError, match="no muons"):
        transport(sample_of(10.0, n=0), 10.0, seed=1, progress=False)


@pytest.mark.parametrize("thickness", [0.0, -1.0, math.nan, math.inf])
def test_a_slab_without_a_positive_thickness_is_refused(thickness: float) -> None:
    with pytest.raises(RefusedError, match="thick"):
        transport(sample_of(10.0), thickness, seed=1, progress=False)


def test_a_negative_seed_and_no_processes_are_refused() -> None:
    with pytest.raises(RefusedError, match="seed -1"):
        transport(sample_of(10.0), 10.0, seed=-1, progress=False)
    with pytest.raises(RefusedError, match="0 processes"):
        transport(sample_of(10.0), 10.0, seed=1, processes=0, progress=False)


def test_muons_under_water_do_not_go_on_through_rock() -> None:
    under_water = sample_of(10.0).then("moved", depth_m=10.0)
    for other in ({"material": "G4_CONCRETE"}, {"density": 1.025}):
        with pytest.raises(RefusedError, match="G4_WATER"):
            transport(under_water, 10.0, seed=1, progress=False, **other)


def test_standard_rock_takes_the_energy_that_the_particle_data_group_says() -> None:
    # Review of Particle Physics, "Cosmic rays", table of muon ranges in standard rock: at 10 GeV a = 2.17 MeV cm2/g,
    # and b = 1.40e-6 cm2/g without nuclear interactions. 1 m takes 0.58 GeV of the 10, which lowers a + b E by 0.3 %:
    # 0.5 % of tolerance for that and the rounding of a, and 4 errors of the mean (0.3 % each), one false alarm in
    # 16,000.
    found = transport(sample_of(10.0, n=20_000), 1.0, seed=18, material="standard_rock", progress=False)
    energy = found.sample.muons.kinetic_energy.astype(np.float64)
    loss, error = 10 - energy.mean(), energy.std() / math.sqrt(len(energy))
    assert len(energy) > 19_990
    assert loss == pytest.approx(265e-3 * (2.17 + 1.40e-6 * 1e4), abs=4 * error + 0.005 * loss)
    assert found.sample.medium == "standard_rock 2.65 g/cm3"


@pytest.mark.parametrize(("material", "own"), [("G4_WATER", 1.0), ("standard_rock", 2.65)])
def test_at_twice_the_density_half_the_thickness_takes_as_much(material: str, own: float) -> None:
    # But for the density effect, which lowers the loss by 2.5 %: half of ln 2, of the 14 that the bracket of Bethe's
    # formula is. 4 standard errors and 0.3 % for the rounding of that: one false alarm in 16,000.
    losses, errors = [], []
    for thickness, density in ((1.0, own), (0.5, 2 * own)):
        found = transport(
            sample_of(10.0, n=20_000), thickness, seed=19, material=material, density=density, progress=False
        )
        energy = found.sample.muons.kinetic_energy.astype(np.float64)
        losses.append(10 - energy.mean())
        errors.append(energy.std() / math.sqrt(len(energy)))
        assert found.sample.medium == f"{material} {density:g} g/cm3"
    assert losses[1] == pytest.approx(0.975 * losses[0], abs=4 * math.hypot(*errors) + 0.003 * losses[0])


def test_muons_start_all_over_a_box_and_are_lost_by_its_sides() -> None:
    # Muons of 1 TeV at 45 degrees go straight on: of a slab 10 m thick and 40 m x 20 m wide a quarter leaves by the
    # sides where they go along x, half where they go along y. 4 standard errors of a binomial number of 10,000.
    for azimuth, lost in ((0.0, 0.25), (math.pi / 2, 0.5)):
        before = sample_of(1000.0, math.sqrt(0.5), azimuth, n=10_000)
        found = transport(before, 10.0, seed=20, box=(40.0, 20.0), progress=False)
        assert found.sideways / 10_000 == pytest.approx(lost, abs=4 * math.sqrt(lost * (1 - lost) / 10_000))
        assert found.sideways + found.stopped + len(found.sample) == 10_000
        assert "40 m x 20 m wide" in found.sample.provenance[-1]


def test_an_infinite_slab_has_no_sides() -> None:
    before = power_law_sample(5000, 1.0, seed=14)
    assert transport(before, 5.0, seed=21, progress=False).sideways == 0


@pytest.mark.parametrize("box", [(0.0, 1.0), (1.0, -1.0), (1.0, math.nan), (math.inf, 1.0)])
def test_a_box_without_positive_widths_is_refused(box: tuple[float, float]) -> None:
    with pytest.raises(RefusedError, match="widths"):
        transport(sample_of(10.0), 10.0, seed=1, box=box, progress=False)


def test_an_unknown_material_is_refused_and_similar_ones_are_named() -> None:
    with pytest.raises(RefusedError, match=r"no material G4_CONCRET: .* G4_CONCRETE") as refusal:
        transport(sample_of(10.0), 10.0, seed=1, material="G4_CONCRET", progress=False)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("density", [0.0, -1.0, math.nan, math.inf, 1000.0])
def test_a_density_that_no_matter_has_is_refused(density: float) -> None:
    with pytest.raises(RefusedError, match="density"):
        transport(sample_of(10.0), 10.0, seed=1, density=density, progress=False)


def test_a_geant4_process_that_fails_is_an_error_with_its_last_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport_module, "check_material", lambda *_: None)
    with pytest.raises(FailedError, match="Geant4 knows no material G4_CHEESE") as failure:
        transport(sample_of(10.0), 10.0, seed=1, material="G4_CHEESE", progress=False)
    assert "\n" not in str(failure.value)


def geant4_processes(folder: Path) -> list[int]:
    """Return the numbers of the Geant4 processes that work in a folder."""
    numbers = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    return [number for number in numbers if f"geant4_slab\0{folder}" in command_line(number)]


def command_line(number: int) -> str:
    try:
        return Path(f"/proc/{number}/cmdline").read_text()
    except OSError:  # it has just ended
        return ""


def wait_until(condition: Callable[[], object], seconds: float = 60) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.1)


@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_the_geant4_processes_end_with_the_program_that_wanted_them(tmp_path: Path, end: signal.Signals) -> None:
    program = """
import numpy as np
from deepmuon_runtime.muons import Muons
from deepmuon_training.sample import Sample
from deepmuon_training.transport.slab import transport
n = 1_000_000
zero = np.zeros(n, np.float32)
muons = Muons(zero + 10, zero, zero, zero - 1, np.full(n, 13, np.int8))
transport(Sample(muons, 0.0, "test"), 10.0, seed=1, processes=2, progress=False)
"""
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    asking = subprocess.Popen([sys.executable, "-c", program], env=environment, stderr=subprocess.DEVNULL)
    wait_until(lambda: len(geant4_processes(tmp_path)) == 2 and list(tmp_path.glob("*/chunk-*")))
    asking.send_signal(end)
    asking.wait(30)
    wait_until(lambda: not geant4_processes(tmp_path))
    if end == signal.SIGINT:
        assert not list(tmp_path.iterdir())
