"""Muons of equal weight at a depth, from weighted trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_training.underground.integration import Integral, generators, weigh
from deepmuon_training.underground.place import Place
from deepmuon_training.underground.proposal import Proposal
from deepmuon_training.underground.workers import Workers

__all__ = ["REPEATED", "Unweighting"]

REPEATED = 2e-3
"""Share of the muons that repeat another. A few trials have 5 to 10 times the mean weight: were the ceiling above them,
so many fewer would be accepted."""

CHUNK = 20_000  # trials, which have random numbers of their own

SAMPLE = 0
"""Which of a seed's random numbers are for samples; see `deepmuon_training.underground.integration`."""

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Unweighting:
    """How trials become muons of equal weight: each is accepted with the probability weight / ceiling.

    One whose weight exceeds the ceiling becomes several muons, weight / ceiling on average, which differ in azimuth.

    Parameters
    ----------
    at
        The depth.
    proposal
        Of the trials.
    ceiling
        Weight of a muon.
    repeated
        Share of muons that repeat another.
    """

    at: Place
    proposal: Proposal
    ceiling: float
    repeated: float

    @classmethod
    def of(cls, at: Place, rate: Integral) -> Unweighting:
        """Return that with the lowest ceiling that repeats no more than `REPEATED` of the muons, by an integration."""
        weights = np.sort(rate.weights)[::-1]
        above = np.cumsum(weights) - np.arange(1, len(weights) + 1) * weights  # by how much weights exceed each
        last = int(np.searchsorted(above, REPEATED * weights.sum(), side="right")) - 1
        return cls(at, rate.proposal, float(weights[last]), float(above[last] / weights.sum()))

    def chunk(self, workers: Workers, seed: int, number: int) -> Muons:
        """Return the muons of one chunk of trials, which its number and the seed decide."""
        random, mulders = generators(seed, SAMPLE, number)
        trials = self.proposal.draw(CHUNK, random, evenly=False)
        weighted = weigh(self.at, workers, trials, mulders)
        copies = np.floor(weighted.both / self.ceiling + random.random(CHUNK)).astype(np.int64)
        chosen = np.repeat(np.arange(CHUNK), copies)
        positive = random.random(len(chosen)) * weighted.both[chosen] < weighted.plus[chosen]
        azimuth = 2 * np.pi * random.random(len(chosen))
        cosine = trials.cos_zenith[chosen]
        sine = np.sqrt((1 - cosine) * (1 + cosine))
        u, v = sine * np.cos(azimuth), sine * np.sin(azimuth)
        return Muons.of(trials.energy[chosen], u, v, -cosine, np.where(positive, MU_PLUS, MU_MINUS))
