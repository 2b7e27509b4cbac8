from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from deepmuon_runtime.latents.arrivals import Arrivals

SEEDS = 400


def test_numbers_have_the_poisson_mean_and_variance():
    """For less than a slot, and for three and a half. At 5 standard deviations each: 2e-6 false alarms."""
    for live_time in (0.37, 3.5):
        mean = 1e5 * live_time
        numbers = np.array([Arrivals(1e5, seed, 7, live_time).count for seed in range(SEEDS)])
        deviations = (numbers - mean) / math.sqrt(mean)
        assert abs(deviations.mean()) < 5 / math.sqrt(SEEDS)
        assert abs(deviations.var() - 1) < 5 * math.sqrt(2 / SEEDS)


def test_times_between_muons_are_exponential():
    """The Kolmogorov-Smirnov distance of 350,000 gaps, over 2.5 / sqrt(n): 7e-6 false alarms."""
    arrivals = Arrivals(1e5, 1, 7, 3.5)
    times = arrivals.times(range(arrivals.count))
    gaps = np.sort(np.diff(times, prepend=0)) * 1e5
    expected = 1 - np.exp(-gaps)
    distance = np.abs(expected - np.arange(len(gaps)) / len(gaps)).max()
    assert distance < 2.5 / math.sqrt(len(gaps))


@settings(deadline=None, max_examples=15)
@given(
    rate=st.floats(1e-3, 1e9),
    slots=st.floats(1e-6, 3000),
    shorter=st.floats(0.01, 1),
    data=st.data(),
)
def test_a_shorter_live_time_is_the_beginning_of_a_longer_one_and_any_part_can_be_made_alone(
    rate: float, slots: float, shorter: float, data: st.DataObject
):
    live_time = slots * 1e5 / rate
    long, short = Arrivals(rate, 3, 4, live_time), Arrivals(rate, 3, 4, live_time * shorter)
    assert short.count <= long.count
    start = data.draw(st.integers(0, short.count))
    stop = data.draw(st.integers(start, min(short.count, start + 300_000)))
    times = long.times(range(start, stop))
    assert len(times) == stop - start
    assert (np.diff(times) >= 0).all()
    assert ((times >= 0) & (times < live_time * shorter)).all()
    assert np.array_equal(short.times(range(start, stop)), times)
    middle = (start + stop) // 2
    parts = [long.times(range(start, middle)), long.times(range(middle, stop))]
    assert np.array_equal(np.concatenate(parts), times)


def test_the_first_times_of_a_seed_never_change():
    arrivals = Arrivals(100.0, 1, 0, 3600.0)
    assert arrivals.count == 360709
    assert arrivals.times(range(3)).tolist() == [0.0037105610085630403, 0.006763768078399401, 0.01356673022068211]
