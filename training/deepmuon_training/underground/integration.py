"""Rates and vertical intensities at a depth, with their errors."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_runtime.ordered_map import ordered_map
from deepmuon_training.underground.place import Place
from deepmuon_training.underground.proposal import Proposal, Trials, proposal, sharpened
from deepmuon_training.underground.workers import Workers

__all__ = [
    "PRECISION",
    "VERTICAL",
    "Integral",
    "Weighted",
    "generators",
    "plane_integral",
    "vertical_integral",
    "weigh",
]

PRECISION = 1e-3
"""Relative standard error at which an integration ends."""

VERTICAL = 0.999
"""cos zenith from which on muons count as vertical: 5 km deep, where the intensity goes as cos zenith to the sixth, it
is 0.3 % less than at 1 on average, and elsewhere nearer."""

BATCH = 10_000  # trials
FEWEST, MOST = 12, 400  # batches

HIGHEST_SHARE = 0.05
"""Of a rate that may come from the upper half of a flux's energies. A flux that falls faster than its square, as they
do, then lacks no more than 1 % for the energies that it has not."""

INTEGRATION = 1
"""Which of a seed's random numbers are for integrations; those for samples are 0."""

Float = NDArray[np.float64]


class Weighted(NamedTuple):
    """Trials, and what they stand for.

    Parameters
    ----------
    trials
        n of them.
    origin_energy
        Kinetic energy [GeV] at the surface.
    plus, minus
        Flux of mu+ and of mu- through a horizontal plane over the density of the trial [1/(m2 s)]: the mean over
        trials is a rate.
    """

    trials: Trials
    origin_energy: Float
    plus: Float
    minus: Float

    @property
    def both(self) -> Float:
        """Both charges."""
        return self.plus + self.minus


@dataclass(frozen=True)
class Integral:
    """An integral over the muons of a depth.

    Parameters
    ----------
    value, error
        Itself, and its standard error.
    proposal
        From which the trials came.
    trials
        All of them.
    plus, minus
        Their weights as mu+ and as mu-: the mean of the sums is the value.
    """

    value: float
    error: float
    proposal: Proposal
    trials: Trials
    plus: Float
    minus: Float

    @property
    def weights(self) -> Float:
        """Weights of the trials."""
        return self.plus + self.minus

    @property
    def positive(self) -> float:
        """Share of mu+."""
        return float(self.plus.sum() / self.weights.sum())

    @property
    def mean_energy(self) -> float:
        """Mean kinetic energy [GeV]."""
        return float(np.average(self.trials.energy, weights=self.weights))


def plane_integral(at: Place, workers: Workers, *, seed: int, precision: float = PRECISION) -> Integral:
    """Integrate the muons of both charges, 1 MeV to 100 TeV, that cross a horizontal plane downwards [1/(m2 s)].

    Parameters
    ----------
    at
        Where.
    workers
        To carry muons back; their number does not change the result.
    seed
        0 or more.
    precision
        Relative error at which to stop; a larger one remains if 4,000,000 trials do not reach it.

    Raises
    ------
    RefusedError
        If the flux ends at energies of which many muons come there.
    FailedError
        If mulder fails.
    """
    return _integral(at, workers, proposal(at), seed, precision)


def vertical_integral(at: Place, workers: Workers, *, seed: int, precision: float = PRECISION) -> Integral:
    """Integrate the intensity of muons of both charges, 1 MeV to 100 TeV, near the vertical [1/(m2 s sr)].

    Parameters and errors are those of `plane_integral`.
    """
    found = _integral(at, workers, proposal(at, VERTICAL, columns=1), seed, precision)
    solid_angle = np.pi * (1 - VERTICAL**2)  # of which a horizontal plane is seen
    return Integral(
        found.value / solid_angle,
        found.error / solid_angle,
        found.proposal,
        found.trials,
        found.plus / solid_angle,
        found.minus / solid_angle,
    )


def weigh(at: Place, workers: Workers, trials: Trials, seed: int) -> Weighted:
    """Carry trials back to the surface, and weigh them by the flux there."""
    origins = workers.carry_back(at.mode, at.depth, trials.energy, trials.cos_zenith, seed)
    plus, minus = at.intensities(origins)
    by_density = trials.cos_zenith / trials.density
    return Weighted(trials, origins.energy, plus * by_density, minus * by_density)


def generators(seed: int, purpose: int, number: int) -> tuple[np.random.Generator, int]:
    """Return NumPy's generator, and mulder's seed, for one batch of a purpose."""
    of_trials, of_mulder = np.random.SeedSequence(seed, spawn_key=(purpose, number)).spawn(2)
    return np.random.default_rng(of_trials), int(of_mulder.generate_state(1, np.uint64)[0])


def _integral(at: Place, workers: Workers, first: Proposal, seed: int, precision: float) -> Integral:
    def batch(number: int, by: Proposal) -> Weighted:
        random, mulders = generators(seed, INTEGRATION, number)
        return weigh(at, workers, by.draw(BATCH, random, evenly=True), mulders)

    pilot = [batch(0, first), batch(1, first)]
    _refuse_cut(at, pilot)
    by = sharpened(first, _trials(pilot), np.concatenate([one.both for one in pilot]))
    found: list[Weighted] = []
    with closing(ordered_map(lambda number: batch(number, by), range(2, 2 + MOST), workers.number)) as batches:
        for one in batches:
            found.append(one)
            if len(found) >= FEWEST and _error(found) <= precision * _mean(found):
                break
    plus, minus = (
        np.concatenate(of_charge) for of_charge in zip(*((one.plus, one.minus) for one in found), strict=True)
    )
    return Integral(_mean(found), _error(found), by, _trials(found), plus, minus)


def _trials(found: list[Weighted]) -> Trials:
    names = [field.name for field in fields(Trials)]
    return Trials(*(np.concatenate([getattr(one.trials, name) for one in found]) for name in names))


def _mean(found: list[Weighted]) -> float:
    return float(np.mean([one.both.mean() for one in found]))


def _error(found: list[Weighted]) -> float:
    """Return the standard error of the mean, from the scatter of batches: evenly drawn trials are not independent."""
    return float(np.std([one.both.mean() for one in found], ddof=1) / np.sqrt(len(found)))


def _refuse_cut(at: Place, found: list[Weighted]) -> None:
    """Refuse a flux that ends where many of the muons come from."""
    total = sum(float(one.both.sum()) for one in found)
    if total == 0:
        raise FailedError(f"none of {len(found) * BATCH:,} muons could come to {at.depth:g} m from the flux")
    high = sum(float(one.both[one.origin_energy > at.flux.energy_max / 2].sum()) for one in found) / total
    if high > HIGHEST_SHARE:
        raise RefusedError(
            f"the flux {at.flux.name} ends at {at.flux.energy_max:g} GeV, and {high:.0%} of the muons {at.depth:g} m "
            f"deep come from its upper half: give a smaller depth, or a flux of higher energies"
        )
