"""A function over many items in parallel, its results in order, never many of them in memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import chain
from typing import TypeVar

from deepmuon_runtime.memory_limit import affordable

__all__ = ["ordered_map"]

LARGEST_LEAD = 8  # results: a caller who is as fast as the threads needs no more, however many they are

Item = TypeVar("Item")
Result = TypeVar("Result")


def ordered_map(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    threads: int,
    abandon: Callable[[], object] = lambda: None,
) -> Generator[Result, None, None]:
    """Yield `function(item)` for each item, in order, computed ahead by threads.

    Parameters
    ----------
    function
        What to compute; it gains from threads as far as it lets go of Python's lock.
    items
        Taken one by one as they are needed.
    threads
        How many run side by side; fewer where the system refuses to start so many, or the memory is limited, and none
        but the caller's at worst.
        As many results again may wait for the caller, and 8 at most.
    abandon
        Called at the end, also where the caller stops before it: what still runs may then stop too.
    """
    rest = iter(items)
    threads = affordable(threads)
    while threads:
        refused: list[Item] = []
        yield from _mapped(function, rest, threads, refused, abandon)
        if not refused:
            return
        rest = chain(refused, rest)
        threads //= 2
    yield from map(function, rest)


def _mapped(
    function: Callable[[Item], Result],
    items: Iterator[Item],
    threads: int,
    refused: list[Item],
    abandon: Callable[[], object],
) -> Generator[Result, None, None]:
    """Do so by exactly so many threads; where one can't be started, stop and leave its item in `refused`."""
    pending: deque[Future[Result]] = deque()
    most = threads + min(threads, LARGEST_LEAD)
    pool = ThreadPoolExecutor(threads, thread_name_prefix="muons")
    try:
        for item in items:
            try:
                pending.append(pool.submit(function, item))
            except RuntimeError:
                refused.append(item)
                break
            if len(pending) > most:
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()
    finally:
        if not refused:  # else the rest is computed by fewer
            abandon()
        pool.shutdown(cancel_futures=True)
