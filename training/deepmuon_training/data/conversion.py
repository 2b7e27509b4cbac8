"""What has to be stated of muons whose file does not say it: depth, rate and charge; and what is told of the rest."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_runtime.physical import LOWEST_ENERGY
from deepmuon_training.sample import Sample

__all__ = ["draw_charges", "drop_lowest", "state_rate", "take_rate", "unweighted", "warn_of_dropped"]

MANY_DROPPED = 0.01
"""Of CRY's muons 2e-4 are below 1 MeV."""

LARGER = {"eV": "keV", "keV": "MeV", "MeV": "GeV", "GeV": "TeV"}
"""What was meant where many energies are too small."""

FEWEST_WEIGHTED = 100


def drop_lowest(sample: Sample, unit: str) -> Sample:
    """Leave the muons below 1 MeV out of a sample, which says so, and out of its rate.

    Parameters
    ----------
    sample
        Any muons.
    unit
        The unit in which their energies were read: where many are dropped it may be the wrong one.

    Raises
    ------
    RefusedError
        If none is left.
    """
    kept = sample.muons.kinetic_energy >= LOWEST_ENERGY
    dropped = int(np.sum(~kept))
    if not dropped:
        return sample
    if dropped == len(sample):
        raise RefusedError(f"there is no muon of at least 1 MeV among {len(sample):,}{_question(unit)}")
    warn_of_dropped(dropped, len(sample), unit)
    fraction = float(np.mean(kept))
    rates = {
        name: None if rate is None else rate * fraction
        for name, rate in (("rate", sample.rate), ("rate_uncertainty", sample.rate_uncertainty))
    }
    told = f"{dropped:,} of {len(sample):,} muons below 1 MeV dropped"
    return sample.then(told, muons=sample.muons[kept], **rates)


def warn_of_dropped(dropped: int, total: int, unit: str) -> None:
    """Warn of a large share of muons that are dropped, with the likely cause; `unit` as for `drop_lowest`."""
    if dropped > MANY_DROPPED * total:
        told = f"{dropped:,} of {total:,} muons are below 1 MeV, and dropped{_question(unit)}"
        warnings.warn(told, stacklevel=2)


def _question(unit: str) -> str:
    return f": are the energies in {LARGER[unit]}, and not in {unit}?" if unit in LARGER else ""


def unweighted(muons: Muons, weights: NDArray[np.float64], seed: int) -> tuple[Muons, str]:
    """Turn weighted muons into fewer that all weigh the same, each kept with a probability of its weight.

    Parameters
    ----------
    muons
        n of them.
    weights : float64 [n]
        Not negative.
    seed
        Seed of NumPy's default generator.

    Returns
    -------
    The muons that are kept, in their order, and what was done. The effective size is (sum of w)^2 / sum of w^2
    (L. Kish, Survey Sampling, 1965).

    Raises
    ------
    RefusedError
        If the effective size, or the number that is kept on average, is below 100.
    """
    largest = weights.max()
    if largest == weights.min() > 0:
        return muons, "the weights are all the same"
    relative = weights / largest if largest > 0 else weights
    effective = relative.sum() ** 2 / max(1.0, (relative**2).sum())
    if effective < FEWEST_WEIGHTED:
        raise RefusedError(
            f"{len(weights):,} muons of these weights are worth {effective:.3g} of one weight, and "
            f"{FEWEST_WEIGHTED} are the fewest"
        )
    if relative.sum() < FEWEST_WEIGHTED:
        raise RefusedError(
            f"one muon weighs {len(weights) / relative.sum():,.0f} times the mean: of {len(weights):,} only "
            f"{relative.sum():.0f} would be kept, and {FEWEST_WEIGHTED} are the fewest"
        )
    kept = np.random.default_rng((seed, 1)).random(len(weights)) < relative  # not the numbers that draw charges
    return muons[kept], (
        f"unweighted by accept-reject, seed {seed}: {kept.sum():,} of {len(weights):,} muons kept, "
        f"effective size {effective:,.0f}"
    )


def state_rate(sample: Sample, rate: float, uncertainty: float | None = None) -> Sample:
    """Give a sample the rate of its muons [1/(m2 s)] that somebody knows."""
    error = "" if uncertainty is None else f" +- {uncertainty:g}"
    return sample.then(f"rate stated: {rate:g}{error} per m2 and s", rate=rate, rate_uncertainty=uncertainty)


def take_rate(sample: Sample, live_time: float, area: float, count_variance: float = 1.0) -> Sample:
    """Give a sample the rate at which its muons came.

    Parameters
    ----------
    sample
        All muons that came.
    live_time
        In how many seconds.
    area
        Through how many square metres of the horizontal plane.
    count_variance
        Variance of their number, in units of Poisson's.
    """
    exposure = live_time * area
    return sample.then(
        f"rate from {len(sample)} muons in {live_time:g} s on {area:g} m2",
        rate=len(sample) / exposure,
        rate_uncertainty=math.sqrt(count_variance * len(sample)) / exposure,
    )


def draw_charges(sample: Sample, ratio: float, seed: int) -> Sample:
    """Give each muon a charge, independent of its energy and direction.

    Parameters
    ----------
    sample
        Muons, of any charge.
    ratio
        mu+ for each mu-: 0 for mu- alone, infinity for mu+ alone.
    seed
        Seed of NumPy's default generator.
    """
    probability = 1.0 if math.isinf(ratio) else ratio / (1 + ratio)
    positive = np.random.default_rng(seed).random(len(sample)) < probability
    muons = replace(sample.muons, pdg_id=np.where(positive, MU_PLUS, MU_MINUS).astype(np.int8))
    if probability in (0, 1):
        return sample.then(f"charge stated: all mu{'-+'[int(probability)]}", muons=muons)
    return sample.then(f"charge drawn: {ratio:g} mu+ for each mu-, seed {seed}", muons=muons)
