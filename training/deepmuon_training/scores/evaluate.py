"""Evaluates generated muons against held-out ones, every score with the noise of two alike samples."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY
from deepmuon_training.scores.azimuth import compare_azimuth
from deepmuon_training.scores.classifier import classify
from deepmuon_training.scores.evaluation import Evaluation, Spectra
from deepmuon_training.scores.histograms import (
    compare_cells,
    compare_charge,
    compare_energy_bins,
    compare_tails,
    compare_zenith_bins,
    count_muons,
)
from deepmuon_training.scores.independence import measure_independence
from deepmuon_training.scores.kolmogorov_smirnov import kolmogorov_smirnov
from deepmuon_training.scores.totals import (
    Rate,
    compare_charge_ratio,
    compare_rate,
    count_unphysical,
    is_physical,
)

__all__ = ["FEWEST_MUONS", "evaluate"]

FEWEST_MUONS = 100_000
"""Physical muons that either sample must hold: the scores' noise is that of large samples."""


def evaluate(
    generated: Muons | Iterable[Muons],
    truth: Muons,
    *,
    seed: int,
    muons_per_draw: int = 1,
    raw_truth: Muons | None = None,
    generated_rate: Rate | None = None,
    truth_rate: Rate | None = None,
    variance_factor: float = 1.0,
    energy_range: tuple[float, float] = (LOWEST_ENERGY, HIGHEST_ENERGY),
    unphysical_before_mapping: float | None = None,
) -> Evaluation:
    """Compare generated muons with held-out ones.

    All noise is that of independent muons, unless `variance_factor` says otherwise of the held-out ones. Where a draw
    is a correlated set (`muons_per_draw` above 1), the counts of generated muons fluctuate otherwise, and
    `independence` says by how much. Charges, azimuths and the classifier are taken
    as independent in any case.
    Unphysical muons are counted, and left out of every other score.

    Parameters
    ----------
    generated
        The generated sequence, or its chunks, in the order in which it was made, beginning with a whole draw.
    truth
        Muons that trained nothing, of the distribution to be learned.
    seed
        Of the classifier and its choice of muons.
    muons_per_draw
        Muons that the generator makes together.
    raw_truth
        Held-out muons with the histogram steps still in, compared on CRY's cells only.
    generated_rate, truth_rate
        Rate and its statistical standard uncertainty [Hz/m2], where known.
    variance_factor
        How many times larger than of independent muons the variance of held-out counts is: above 1 where muons come in
        showers.
    energy_range
        Lowest and highest energy [GeV] that the generator may give.
    unphysical_before_mapping
        Fraction of unphysical muons before the generator's graph mapped them, where known.

    Raises
    ------
    RefusedError
        For fewer than 100,000 physical muons of either, or fewer than 100 draws, or a variance factor below 0.
    """
    if not 0 < variance_factor < inf:
        raise RefusedError(f"the variance factor is {variance_factor:g}, and should be above 0: 1 is independence")
    v = variance_factor
    everything = generated if isinstance(generated, Muons) else Muons.concatenate(list(generated) or [truth[:0]])
    p = _physical(everything, energy_range, "generated")
    q = _physical(truth, energy_range, "held-out")
    p_counts, q_counts = count_muons(p), count_muons(q)
    return Evaluation(
        generated_muons=len(p),
        held_out_muons=len(q),
        muons_per_draw=muons_per_draw,
        seed=seed,
        ks={
            "energy": kolmogorov_smirnov(p.kinetic_energy, q.kinetic_energy, v),
            "u": kolmogorov_smirnov(p.u, q.u, v),
            "v": kolmogorov_smirnov(p.v, q.v, v),
            "cos zenith": kolmogorov_smirnov(p.cos_zenith, q.cos_zenith, v),
        },
        cells=compare_cells(p_counts, q_counts, v),
        cells_against_raw=None if raw_truth is None else compare_cells(p_counts, count_muons(raw_truth), v),
        energy_bins=compare_energy_bins(p_counts, q_counts, v),
        zenith_bins=compare_zenith_bins(p, q, v),
        tails=compare_tails(p, q, v),
        charge=compare_charge(p_counts, q_counts),
        charge_ratio=compare_charge_ratio(p, q),
        azimuth=compare_azimuth(p, q),
        classifier=classify(p, q, seed=seed),
        independence=measure_independence(p, muons_per_draw),
        unphysical=count_unphysical(everything, energy_range, unphysical_before_mapping),
        rate=compare_rate(generated_rate, truth_rate) if generated_rate and truth_rate else None,
        generated_spectra=Spectra.of(p_counts),
        held_out_spectra=Spectra.of(q_counts),
        variance_factor=v,
    )


def _physical(muons: Muons, energy_range: tuple[float, float], what: str) -> Muons:
    """Leave out unphysical muons, or refuse if too few are left."""
    physical = is_physical(muons, energy_range)
    kept = int(np.count_nonzero(physical))
    if kept < FEWEST_MUONS:
        raise RefusedError(
            f"{kept} physical {what} muons (of {len(muons)}) are too few to evaluate, need {FEWEST_MUONS}"
        )
    return muons if kept == len(muons) else muons[physical]
