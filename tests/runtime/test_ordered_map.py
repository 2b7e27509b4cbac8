from __future__ import annotations

import threading
import time
from contextlib import closing

import pytest

from deepmuon_runtime.ordered_map import ordered_map


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_results_come_in_the_order_of_the_items(threads):
    def slow_if_early(item: int) -> int:
        time.sleep(0.002 * (item % 3 == 0))
        return item * item

    assert list(ordered_map(slow_if_early, range(40), threads)) == [item * item for item in range(40)]


def test_as_many_run_side_by_side_as_there_are_threads():
    together = threading.Barrier(3, timeout=20)
    assert len(list(ordered_map(lambda _: together.wait(), range(3), 3))) == 3


@pytest.mark.parametrize(("threads", "most"), [(2, 4), (64, 72)])
def test_no_more_is_taken_than_the_caller_needs_soon(threads, most):
    items = iter(range(1000))
    with closing(ordered_map(lambda item: item, items, threads)) as results:
        assert [next(results) for _ in range(10)] == list(range(10))
        assert next(items) <= 10 + most


def test_an_error_comes_in_its_turn_and_ends_the_rest():
    done = []

    def fail_at_three(item: int) -> int:
        if item == 3:
            raise ValueError("three")
        return item

    def collect() -> None:
        for result in ordered_map(fail_at_three, range(1000), 2):
            done.append(result)

    with pytest.raises(ValueError, match="three"):
        collect()
    assert done == [0, 1, 2]


@pytest.mark.parametrize("started", range(5))
def test_where_the_system_starts_fewer_threads_the_results_are_the_same(monkeypatch, started):
    """As many as the limit of processes leaves, down to none."""
    start, alive = threading.Thread.start, []

    def start_few(thread: threading.Thread) -> None:
        if sum(other.is_alive() for other in alive) >= started:
            raise RuntimeError("can't start new thread")
        alive.append(thread)
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", start_few)
    assert list(ordered_map(lambda item: item * item, range(40), 4)) == [item * item for item in range(40)]
