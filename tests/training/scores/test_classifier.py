from __future__ import annotations

from dataclasses import replace

import numpy as np

from deepmuon_runtime.muons import MU_PLUS
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.scores.classifier import classify


def test_alike_muons_can_not_be_told_apart():
    # 4 sigma: a false alarm in 16,000
    score = classify(sea_level_muons(60_000, seed=1), sea_level_muons(40_000, seed=2), seed=3)
    assert (score.trained, score.tested) == (20_000, 20_000)
    assert abs(score.auc - 0.5) < 4 * score.noise


def test_the_noise_is_that_of_mann_and_whitney():
    score = classify(sea_level_muons(4000, seed=1), sea_level_muons(4000, seed=2), seed=3)
    random = np.random.default_rng(4)
    ranks = [np.argsort(np.argsort(random.random(4000)))[:2000].sum() / 2000**2 for _ in range(1000)]
    assert abs(np.std(ranks) / score.noise - 1) < 0.1  # 4 sigma


def test_a_charge_that_follows_the_energy_is_told():
    truth, generated = sea_level_muons(40_000, seed=1), sea_level_muons(40_000, seed=2)
    plus = generated.kinetic_energy < np.quantile(generated.kinetic_energy, 1.28 / 2.28)
    sorted_out = replace(generated, pdg_id=np.where(plus, MU_PLUS, -MU_PLUS).astype(np.int8))
    assert classify(sorted_out, truth, seed=3).auc > 0.7


def test_one_seed_gives_one_score():
    truth, generated = sea_level_muons(3000, seed=1), sea_level_muons(4000, seed=2)
    assert classify(generated, truth, seed=3) == classify(generated, truth, seed=3)
    assert classify(generated, truth, seed=3) != classify(generated, truth, seed=4)
