"""Muons through a slab of matter, by Geant4."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import LOWEST_ENERGY, POSITIVE_ENERGIES, first_unphysical
from deepmuon_training.sample import Sample
from deepmuon_training.transport.geant4_processes import PRIMARY, SlabJob, run_geant4
from deepmuon_training.transport.material import check_material, medium

__all__ = ["Transported", "below_slab", "refuse_none", "transport"]

ONE_SIGMA = 0.6827
"""Confidence of an interval of one standard deviation on each side."""

_LEAST_LOSS = 0.18
"""A muon with E |w| below so many GeV per metre of water is not carried, because it can't arrive.

Minimum ionisation costs 0.2 GeV per metre, and the way is thickness / |w|; straggling and scattering save a
few. Of CRY's muons below 0.18 none of 862,682 came through 10 m, and none of 33,503 (above 0.15) through 50 m;
of those from 0.18 to 0.2, 85 of 69,569 came through 10 m.
"""

_THINNEST_SCREENED = 10.0  # m; through 5 m of water 4 of 82,508 muons below 0.18 GeV/m came

_HIGHEST_ENERGY = 1e5  # GeV, where the tables of Geant4's processes end
_LENGTH_TOLERANCE = 1e-4  # of a direction's length: text formats have few digits


@dataclass(frozen=True)
class Transported:
    """What became of a sample in a slab; started = survivors + screened + stopped + sideways + upward + below_minimum.

    Parameters
    ----------
    sample : Sample
        The survivors, in the order of their primaries: first downward crossings of the lower plane with at
        least 1 MeV.
    started : int
        Muons that were asked for.
    screened : int
        Left out beforehand, because their energy can't carry them through.
    stopped : int
        Stopped or decayed in the slab.
    sideways : int
        Left a slab of finite width by its sides.
    upward : int
        Left it with w >= 0, scattered back through its upper plane.
    below_minimum : int
        Crossed the lower plane with less than 1 MeV.
    """

    sample: Sample
    started: int
    screened: int
    stopped: int
    sideways: int
    upward: int
    below_minimum: int

    @property
    def surviving_fraction(self) -> float:
        """Fraction of the muons that crossed the lower plane."""
        return len(self.sample) / self.started

    @property
    def surviving_fraction_interval(self) -> tuple[float, float]:
        """Its exact interval of 68.27 % confidence, which has a width for no survivor and for all, too."""
        return _interval(len(self.sample), self.started)

    @property
    def surviving_fraction_error(self) -> float:
        """Half the width of that interval."""
        return _error(len(self.sample), self.started)


def transport(
    sample: Sample,
    thickness: float,
    *,
    seed: int,
    processes: int | None = None,
    material: str = "G4_WATER",
    density: float | None = None,
    box: tuple[float, float] | None = None,
    progress: bool = True,
) -> Transported:
    """Carry a sample through a slab by Geant4.

    The same sample and seed give the same survivors, whatever the number of processes. The physics is in
    `geant4_slab`. The slab is infinite, unless `box` limits it: then the muons start at places uniform over its upper
    face, wherever they were before, and those that leave it by its sides are lost.

    Parameters
    ----------
    sample : Sample
        n muons on the upper plane, all downward-going.
    thickness : float
        Thickness of the slab in m.
    seed : int
        Seed of Geant4's random numbers, not negative.
    processes : int, optional
        Geant4 processes to run side by side; by default one per core.
    material : str
        What the slab is made of: Geant4's (NIST) name, or standard_rock (Z = 11, A = 22, 2.65 g/cm3).
    density : float, optional
        Its density in g/cm3, if not the material's own.
    box : (float, float), optional
        Widths of the slab along x and y in m.
    progress : bool
        Whether to draw a progress bar on stderr.

    Returns
    -------
    Transported
        The survivors at depth_m + thickness, at rate x surviving fraction, and how many were lost to what.

    Raises
    ------
    RefusedError
        Before Geant4 starts: an argument is wrong, the sample is empty or holds a muon that can't be carried.
    FailedError
        If a Geant4 process ends without its result.
    """
    processes = os.cpu_count() or 1 if processes is None else processes
    overburden = medium(material, density)
    _check_arguments(sample, thickness, seed, processes, overburden)
    _check_box(box)
    check_material(material, density)
    muons = sample.muons
    carried = np.flatnonzero(muons.kinetic_energy * muons.cos_zenith >= _needed_energy(thickness, overburden))
    job = SlabJob(material, float(thickness), int(seed), density, box)
    exits, sideways = run_geant4(_primaries(muons[carried]), job, processes, progress)
    upward = exits["w"] >= 0
    below_minimum = ~upward & (exits["energy"] < np.float32(LOWEST_ENERGY))
    survivors = exits[~upward & ~below_minimum]
    energy, u, v, w = (np.ascontiguousarray(survivors[name]) for name in ("energy", "u", "v", "w"))
    crossed = Muons(energy, u, v, w, muons.pdg_id[carried[survivors["row"]]])
    started = len(muons)
    return Transported(
        sample=replace(
            below_slab(sample, started, len(crossed), thickness, overburden, _how(seed, box)),
            muons=crossed,
        ),
        started=started,
        screened=started - len(carried),
        stopped=len(carried) - len(exits) - sideways,
        sideways=sideways,
        upward=int(np.sum(upward)),
        below_minimum=int(np.sum(below_minimum)),
    )


def below_slab(sample: Sample, started: int, survived: int, thickness: float, overburden: str, how: str) -> Sample:
    """Return a sample, muons aside, at the lower plane of a slab: its depth, medium, rate and provenance.

    Parameters
    ----------
    sample : Sample
        On the upper plane.
    started, survived : int
        Muons that were asked for, and those that crossed the lower plane.
    thickness : float
        Of the slab in m.
    overburden : str
        What it is made of, as `deepmuon_training.transport.material.medium` says it.
    how : str
        How they were carried, for the provenance.
    """
    fraction, error = survived / started, _error(survived, started)
    return sample.then(
        f"carried through {thickness:g} m of {overburden} by geant4_pybind {version('geant4_pybind')}, "
        f"{how}: {survived} of {started} survived",
        depth_m=sample.depth_m + thickness,
        medium=overburden,
        rate=None if sample.rate is None else sample.rate * fraction,
        rate_uncertainty=_rate_uncertainty(sample, fraction, error),
    )


def _needed_energy(thickness: float, overburden: str) -> float:
    """Return the least E |w| [GeV] with which it is worth to try; 0 where that is not known."""
    known = overburden == "G4_WATER" and thickness >= _THINNEST_SCREENED
    return _LEAST_LOSS * thickness if known else 0.0


def _how(seed: int, box: tuple[float, float] | None) -> str:
    return f"seed {seed}" if box is None else f"{box[0]:g} m x {box[1]:g} m wide, seed {seed}"


def refuse_none(survived: int, started: int, thickness: float, overburden: str) -> None:
    """Raise an error if nothing survived: without a muon there is no sample, and no rate but a limit.

    Parameters
    ----------
    survived, started, thickness, overburden
        As for `below_slab`.

    Raises
    ------
    FailedError
        If nothing did.
    """
    if survived == 0:
        raise FailedError(
            f"none of {started:,} muons survived {thickness:g} m of {overburden} (at 68 % confidence it is below "
            f"{_interval(0, started)[1]:.2g} of them): carry more, or take a thinner slab"
        )


def _interval(survived: int, started: int) -> tuple[float, float]:
    """Return the interval of C. Clopper and E. Pearson, Biometrika 26 (1934) 404."""
    low, high = binomtest(survived, started).proportion_ci(ONE_SIGMA, method="exact")
    return float(low), float(high)


def _error(survived: int, started: int) -> float:
    low, high = _interval(survived, started)
    return (high - low) / 2


def _rate_uncertainty(sample: Sample, fraction: float, error: float) -> float | None:
    """Return the statistical uncertainty of rate x fraction; that of the fraction where the rate's own is unknown."""
    if sample.rate is None or (sample.rate_uncertainty is None and error == 0):
        return None
    return math.hypot((sample.rate_uncertainty or 0.0) * fraction, sample.rate * error)


def _check_arguments(sample: Sample, thickness: float, seed: int, processes: int, overburden: str) -> None:
    if not (math.isfinite(thickness) and thickness > 0):
        raise RefusedError(f"a slab {thickness} m thick: its thickness must be a positive number of metres")
    if seed < 0:
        raise RefusedError(f"seed {seed} is negative: it must be 0 or more")
    if processes < 1:
        raise RefusedError(f"{processes} processes can't carry muons: at least 1 is needed")
    if sample.depth_m > 0 and sample.medium != overburden:
        raise RefusedError(f"muons under {sample.depth_m:g} m of {sample.medium} can't go on in {overburden}")
    if len(sample) == 0:
        raise RefusedError("the sample holds no muons: there is nothing to carry")
    bad = first_unphysical(sample.muons, POSITIVE_ENERGIES[0], _HIGHEST_ENERGY, length_tolerance=_LENGTH_TOLERANCE)
    if bad is not None:
        raise RefusedError(f"muon {bad[0]} {bad[1]}")


def _check_box(box: tuple[float, float] | None) -> None:
    if box is not None and not all(0 < width < math.inf for width in box):
        raise RefusedError(f"a box of {box[0]} m x {box[1]} m: both widths must be positive numbers of metres")


def _primaries(muons: Muons) -> NDArray[np.void]:
    rows = np.empty(len(muons), PRIMARY)
    rows["energy"] = muons.kinetic_energy
    for column in ("u", "v", "w", "pdg_id"):
        rows[column] = getattr(muons, column)
    return rows
