"""Whether an error is for want of memory or threads, which the libraries say in many ways."""

from __future__ import annotations

import errno
from collections.abc import Iterator

__all__ = ["THREADS", "lack"]

MEMORY = "memory ran out: see the limit of the shell (ulimit -v) or the batch system"
THREADS = "the system starts no more threads or processes: see the limit of the shell (ulimit -u) or the batch system"

OF_MEMORY = (
    "failed to map segment",  # the system's loader of libraries
    "annot allocate memory",
    "bad_alloc",  # C++
    "bad allocation",
    "unable to allocate",  # HDF5
    "memory allocation failed",
)
OF_THREADS = ("can't start new thread",)


def lack(error: BaseException) -> str | None:
    """Return what the user should know where an error is for want of memory or threads.

    Parameters
    ----------
    error
        As it was caught; those that it followed from are looked at too.
    """
    for one in _chain(error):
        code = one.errno if isinstance(one, OSError) else None
        text = str(one)
        if isinstance(one, MemoryError) or code == errno.ENOMEM or _says(one, text, OF_MEMORY):
            return MEMORY
        if _says(one, text, OF_THREADS):
            return THREADS
    return None


def _says(error: BaseException, text: str, phrases: tuple[str, ...]) -> bool:
    return isinstance(error, (ImportError, RuntimeError, OSError)) and any(phrase in text for phrase in phrases)


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__
