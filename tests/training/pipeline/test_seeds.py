from __future__ import annotations

from numpy.random import SeedSequence

from deepmuon_training.pipeline.seeds import KINDS, step_seed


def test_the_derivation_is_the_documented_one():
    assert KINDS == ("fit", "draw", "transport", "score")
    for number, kind in enumerate(KINDS):
        for layer in range(3):
            expected = SeedSequence(2**64 - 1, spawn_key=(number, layer)).generate_state(1)[0]
            assert step_seed(2**64 - 1, kind, layer) == expected


def test_no_two_steps_of_a_pipeline_share_a_seed():
    # A thousand different 32-bit numbers: two alike by chance once in 9000 seeds.
    seeds = [step_seed(1, kind, layer) for kind in KINDS for layer in range(250)]
    assert len(set(seeds)) == 1000
