"""A muon file of muons drawn from a flux at sea level."""

from __future__ import annotations

from pathlib import Path

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.writer import MuonWriter
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY
from deepmuon_training.fluxes.flux import Flux
from deepmuon_training.fluxes.plane import plane_rate
from deepmuon_training.fluxes.sampler import PlaneSampler
from deepmuon_training.sample import Sample

__all__ = ["write_sea_level"]

PIECE = 1 << 18  # muons that are drawn at once


def write_sea_level(path: str | Path, flux: Flux, n: int, *, seed: int, overwrite: bool = False) -> Sample:
    """Write n independent muons crossing a horizontal plane at sea level to a muon file.

    Their energies are those of the flux from 1 MeV to 100 TeV, where all that learns or carries muons ends; above is
    one muon in 7,000,000,000 at sea level. Fewer muons of a seed are the first of more; any number needs
    the same memory.

    Parameters
    ----------
    path, overwrite
        As for `deepmuon_runtime.MuonWriter`.
    flux
        Where from.
    n
        How many.
    seed
        0 or more. Piece k of 262,144 muons has the seed (seed, k) of NumPy's default generator.

    Returns
    -------
    What the file says, as a sample without its muons.

    Raises
    ------
    RefusedError
        As for `deepmuon_runtime.MuonWriter`, and if no energy of the flux is among these.
    FailedError
        As for `deepmuon_runtime.MuonWriter` and `deepmuon_training.fluxes.plane.plane_rate`.
    """
    low, high = max(flux.energy_min, LOWEST_ENERGY), min(flux.energy_max, HIGHEST_ENERGY)
    if low >= high:
        raise RefusedError(
            f"the flux {flux.name} is of {flux.energy_min:g} to {flux.energy_max:g} GeV: expected were energies "
            f"between {LOWEST_ENERGY:g} and {HIGHEST_ENERGY:g} GeV"
        )
    sample = Sample(
        Muons.empty(0),
        depth_m=0.0,
        source=f"{flux.origin}, {_energy(low)} to {_energy(high)}",
        provenance=(f"{n} muons drawn, {flux.charges}, seed {seed}",),
        rate=plane_rate(flux, low, high),
        flux=Path(flux.name).stem,
    )
    sampler = PlaneSampler(flux, low, high)
    with MuonWriter(path, sample.attributes, overwrite) as writer:
        for k in range(-(-n // PIECE)):
            writer.append(sampler.draw(PIECE, (seed, k))[: n - k * PIECE])
    return sample


def _energy(gev: float) -> str:
    """Return an energy in the unit that makes it short."""
    scale, unit = (1e-3, "TeV") if gev >= 1e3 else (1.0, "GeV") if gev >= 1 else (1e3, "MeV")
    return f"{gev * scale:g} {unit}"
