"""Samples of which no distribution can be learned: muons that repeat one another, energies that are tied."""

from __future__ import annotations

import numpy as np
from scipy.special import logit

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.learning.support import outermost
from deepmuon_training.scores.independence import count_repeated

__all__ = ["check_repeats", "check_ties"]

_MOST_REPEATED = 0.01
_WIDEST_TIE = 0.1  # in the logit of the level, or of a tail's muons


def check_repeats(muons: Muons) -> None:
    """Refuse a sample in which more than one muon in a hundred repeats an earlier one, bit by bit.

    Raises
    ------
    RefusedError
        That says how many do.
    """
    share = count_repeated(muons) / len(muons)
    if share > _MOST_REPEATED:
        raise RefusedError(
            f"{share:.1%} of the {len(muons):,} muons repeat an earlier one, bit by bit, as resampled muons do: "
            "independent ones are needed, each once"
        )


def check_ties(muons: Muons) -> None:
    """Refuse a sample with so many muons of one kinetic energy that its spectrum has a hole beside it.

    A density has a spike where energies are tied. A tie may be as wide as 0.1 in the logit of the level, which
    is 2.5 % of the muons in the middle of the spectrum and a tenth of those beyond it elsewhere, and it may take a
    tenth of the outermost muons.

    Raises
    ------
    RefusedError
        That names the energy and its share.
    """
    values, counts = np.unique(muons.kinetic_energy, return_counts=True)
    number, tail = len(muons), outermost(len(muons))
    ends = np.concatenate([[0], np.cumsum(counts)])
    width = np.diff(logit(np.clip(ends, tail, number - tail) / number))
    for inner in (np.clip(ends, 0, tail), np.clip(ends, number - tail, number)):
        width = np.maximum(width, np.diff(inner) / tail)
    worst = int(np.argmax(width))
    if width[worst] > _WIDEST_TIE:
        raise RefusedError(
            f"{counts[worst] / number:.2%} of the muons ({counts[worst]:,} of {number:,}) have the same kinetic energy "
            f"of {values[worst]:g} GeV, and {len(values):,} energies differ: rounded or clamped energies can't be "
            "learned, give them as they were"
        )
