"""What has to be stated of muons whose file does not say it: depth, rate and charge."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_runtime.physical import LOWEST_ENERGY
from deepmuon_training.sample import Sample

__all__ = ["draw_charges", "sample_of", "state_rate", "take_rate"]


def sample_of(muons: Muons, what: str, *, source: str, depth_m: float = 0.0, medium: str = "G4_WATER") -> Sample:
    """Make a sample of muons, without those below 1 MeV.

    Parameters
    ----------
    muons
        Their charge may be unknown.
    what
        Begins the provenance.
    source, depth_m, medium
        As for `deepmuon_training.sample.Sample`.

    Raises
    ------
    RefusedError
        If none is left.
    """
    kept = muons.kinetic_energy >= LOWEST_ENERGY
    if not kept.any():
        raise RefusedError(f"{what}: there is no muon of at least 1 MeV among {len(muons):,}")
    dropped = f"{what}: {len(muons)} muons, {np.sum(~kept)} below 1 MeV dropped"
    return Sample(muons[kept], depth_m=depth_m, source=source, provenance=(dropped,), medium=medium)


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
