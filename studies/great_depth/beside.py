"""The same quantities by CRY, EcoMug's formula, mulder's default flux, MUTE and `measured`, from sea level to 6 km w.e.

    python -m studies.great_depth.beside cry_sea_level.h5

The file holds CRY's muons. Under water CRY's were carried by Geant4, and their rates are the released models'; all
others by mulder. MUTE's numbers are those of its own examples and tests. Writes beside.md and beside.json beside
itself; two minutes on two cores.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.generator import Generator
from deepmuon_training.data.cry import read_cry
from deepmuon_training.fluxes.ecomug import ecomug
from deepmuon_training.fluxes.flux import MUON_MASS, Flux
from deepmuon_training.fluxes.gccly import gccly
from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.plane import plane_rate
from deepmuon_training.sample import Sample
from deepmuon_training.underground.integration import Integral, plane_integral, vertical_integral
from deepmuon_training.underground.overburden import OVERBURDENS
from deepmuon_training.underground.place import Place, place
from deepmuon_training.underground.workers import Workers
from studies.measured_flux.data import Bess, read_bess
from studies.shared.report import write

FLUXES = {"`measured`": MEASURED, "EcoMug": ecomug(), "mulder": gccly()}
ORDER = ("`measured`", "CRY", "EcoMug", "mulder", "MUTE")
DEEP = ("`measured`", "mulder")
"""Fluxes that go far enough for kilometres of rock."""

BANDS = ((0.5, 2), (2, 10), (10, 100), (100, 500))
"""Momenta [GeV/c] between which BESS-TeV's bins are added."""

NEAR_VERTICAL = 0.9
"""Least cos zenith of BESS-TeV's muons."""

WATER = (10, 50, 100)
"""Metres."""

ROCK = (1, 3, 6)
"""Kilometres of water equivalent, of standard rock."""

MUTE_TOTAL = (3.5, 1.448e-8)
"""Under so many km w.e. of standard rock, muons per cm2 and s above 100 MeV: test_tot_fluxes.py of version 3."""

MUTE_MEAN_ENERGY = (3.0, 287.9)
"""Under so many km w.e. of standard rock, GeV: example_energy.ipynb, version 3."""

SEED = 16
PRECISION = 3e-3

Float = NDArray[np.float64]
Row = tuple[str, ...]


@click.command(help=__doc__)
@click.argument("cry", type=click.Path(exists=True, path_type=Path))
@click.option("--processes", default=2, show_default=True, help="Of mulder side by side.")
def main(cry: Path, processes: int) -> None:
    """Count, integrate, write."""
    rows = [("", "BESS-TeV", *ORDER), *at_sea_level(read_cry(cry))]
    with Workers(OVERBURDENS["water"], processes) as workers:
        rows += [under_water(depth, workers) for depth in WATER]
    with Workers(OVERBURDENS["rock"], processes) as workers:
        rows += [under_rock(depth, workers) for depth in ROCK]
        rows += beside_mute(workers)
    write(Path(__file__), {"rows": rows}, rows)


def row(what: str, found: dict[str, str], measured: str = "") -> Row:
    """Return a row of the table."""
    return (what, measured, *(found.get(name, "") for name in ORDER))


class Band(NamedTuple):
    """Muons near the vertical and between two momenta, of each charge, mu+ first [1/(m2 s sr)]."""

    plus: float
    minus: float

    @property
    def both(self) -> float:
        """Of both charges."""
        return self.plus + self.minus

    @property
    def ratio(self) -> float:
        """mu+ for each mu-."""
        return self.plus / self.minus


def at_sea_level(cry: Sample) -> Iterator[Row]:
    """Yield rows of bands of momentum near the vertical, of charge ratios, and of rates."""
    bess = read_bess()
    bands = {}
    for low, high in BANDS:
        bins = (bess.mean >= low) & (bess.mean < high)
        width = (bess.high - bess.low)[bins]
        measured = Band(*(bess.flux[:, bins] @ width))
        found = {name: Band(*(bess.predicted(flux.intensity)[:, bins] @ width)) for name, flux in FLUXES.items()}
        found["CRY"] = counted(cry, bess, bins)
        bands[low, high] = measured, found
        relative = {name: f"{band.both / measured.both:.3f}" for name, band in found.items()}
        yield row(f"near the vertical, {low:g} to {high:g} GeV/c, over BESS-TeV's", relative, "1")
    for (low, high), (measured, found) in list(bands.items())[1:]:
        ratios = {name: f"{band.ratio:.2f}" for name, band in found.items()}
        yield row(f"μ⁺/μ⁻ there, {low:g} to {high:g} GeV/c", ratios, f"{measured.ratio:.2f}")
    for above in (1e-3, 1.0):
        assert cry.rate is not None
        rates = {name: f"{plane_rate(flux, above, flux.energy_max):.1f}" for name, flux in FLUXES.items()}
        rates["CRY"] = f"{cry.rate * np.mean(cry.muons.kinetic_energy >= above):.1f}"
        yield row(f"above {'1 MeV' if above < 1 else '1 GeV'}, per m² and s", rates)


def counted(sample: Sample, bess: Bess, bins: NDArray[np.bool_]) -> Band:
    """Count muons of a sample in some of BESS-TeV's bins."""
    assert sample.rate is not None
    muons = sample.muons
    energy, cos_zenith = muons.kinetic_energy.astype(float), muons.cos_zenith.astype(float)
    momentum = np.sqrt(energy * (energy + 2 * MUON_MASS))
    wanted = (momentum >= bess.low[bins][0]) & (momentum < bess.high[bins][-1]) & (cos_zenith > NEAR_VERTICAL)
    solid_angle = 2 * np.pi * (1 - NEAR_VERTICAL)
    weight = sample.rate / len(muons) / solid_angle / cos_zenith
    return Band(*(float(weight[wanted & (muons.charge == charge)].sum()) for charge in (1, -1)))


def at(flux: Flux, medium: str, depth_kmwe: float) -> Place:
    """Return a depth [km w.e.] under a flux."""
    overburden = OVERBURDENS[medium]
    return place(flux, overburden, 1e3 * depth_kmwe / overburden.density)


def integrals(names: Iterable[str], medium: str, depth_kmwe: float, workers: Workers) -> dict[str, Integral]:
    """Integrate what some fluxes send through a horizontal plane at a depth [km w.e.]."""
    return {
        name: plane_integral(at(FLUXES[name], medium, depth_kmwe), workers, seed=SEED, precision=PRECISION)
        for name in names
    }


def under_water(depth_m: float, workers: Workers) -> Row:
    """Return the rates under so many metres of water."""
    found = {name: f"{one.value:.2f}" for name, one in integrals(FLUXES, "water", 1e-3 * depth_m, workers).items()}
    try:
        rate = Generator.open(depth_m).model.rate_hz_per_m2
    except RefusedError:  # no model is so deep
        rate = None
    return row(f"{depth_m:g} m of water, per m² and s", found if rate is None else {**found, "CRY": f"{rate:.2f}"})


def under_rock(depth_kmwe: float, workers: Workers) -> Row:
    """Return the vertical intensities under so much standard rock."""
    found = {
        name: vertical_integral(at(FLUXES[name], "rock", depth_kmwe), workers, seed=SEED, precision=PRECISION)
        for name in DEEP
    }
    intensities = {name: f"{1e-4 * one.value:.3g}" for name, one in found.items()}
    return row(f"{depth_kmwe:g} km w.e. of rock, vertical, per cm², s and sr", intensities)


def beside_mute(workers: Workers) -> Iterator[Row]:
    """Yield what MUTE's examples give."""
    depth, total = MUTE_TOTAL
    totals = {
        name: f"{1e-4 * float((one.weights / one.trials.cos_zenith).mean()):.3g}"
        for name, one in integrals(DEEP, "rock", depth, workers).items()
    }
    yield row(f"{depth:g} km w.e. of rock, all angles, per cm² and s", {**totals, "MUTE": f"{total:.3g}"})
    depth, energy = MUTE_MEAN_ENERGY
    energies = {name: f"{one.mean_energy:.0f}" for name, one in integrals(DEEP, "rock", depth, workers).items()}
    yield row(f"{depth:g} km w.e. of rock, mean energy, GeV", {**energies, "MUTE": f"{energy:.0f}"})


if __name__ == "__main__":
    main()
