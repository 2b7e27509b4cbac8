"""A classifier that tries to tell generated muons from held-out ones."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.metrics import roc_auc_score

from deepmuon_runtime.muons import Muons

__all__ = ["ClassifierScore", "classify"]

_MOST_MUONS = 1_000_000


@dataclass(frozen=True)
class ClassifierScore:
    """How well a classifier tells the two samples apart.

    Parameters
    ----------
    auc : float
        Area under the ROC curve: 0.5 for alike samples, 1 for samples that never look alike.
    noise : float
        Its standard deviation around 0.5 for alike samples, that of the Mann-Whitney statistic,
        sqrt((a + b + 1) / (12 a b)) for a and b muons tested.
    trained, tested : int
        Muons of each sample that trained it, and that it was tested on.
    """

    auc: float
    noise: float
    trained: int
    tested: int


def _features(muons: Muons) -> NDArray[np.float32]:
    columns = (np.log(muons.kinetic_energy), muons.u, muons.v, muons.w, muons.charge)
    return np.stack(columns, axis=1, dtype=np.float32, casting="same_kind")


def classify(generated: Muons, held_out: Muons, *, seed: int) -> ClassifierScore:
    """Train histogram gradient boosting on log E, u, v, w and charge, and test it on other muons.

    Up to 1,000,000 of each sample are drawn at random, as many of one as of the other; half of them train 100
    trees, the other half are tested. Drawn so, muons of one correlated draw rarely meet: the
    score sees the distribution of single muons, and nothing of their order.
    """
    random = np.random.default_rng(seed)
    size = min(len(generated), len(held_out), _MOST_MUONS)
    drawn = [sample[random.choice(len(sample), size, replace=False)] for sample in (generated, held_out)]
    half = size // 2
    trained, tested = (
        np.concatenate([_features(sample[part]) for sample in drawn]) for part in (slice(half), slice(half, 2 * half))
    )
    is_generated = np.repeat([True, False], half)
    model = HistGradientBoostingClassifier(max_iter=100, early_stopping=False, random_state=seed % 2**32)
    model.fit(trained, is_generated)
    auc = roc_auc_score(is_generated, model.decision_function(tested))
    return ClassifierScore(float(auc), sqrt((2 * half + 1) / (12 * half**2)), half, half)
