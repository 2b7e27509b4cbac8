"""Columns of muons in a GPU's memory, and in the computer's where a GPU reaches it."""

from __future__ import annotations

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons

__all__ = ["copied", "empty", "empty_on_host"]


def empty(n: int, *, has_place: bool = False, has_time: bool = False) -> Muons:
    """Return n muons in the GPU's memory, whose columns are yet to be filled.

    Raises
    ------
    RefusedError
        If it does not hold them.
    """
    import cupy

    try:
        return Muons.empty(n, has_place=has_place, has_time=has_time, column=cupy.empty)
    except (MemoryError, ValueError) as error:  # CuPy's own is a MemoryError
        raise RefusedError(_no_room(n)) from error


def empty_on_host(n: int, *, has_place: bool = False, has_time: bool = False) -> Muons:
    """Return the same in the computer's memory, in pages that a GPU copies to at once."""
    from cupyx import empty_pinned

    return Muons.empty(n, has_place=has_place, has_time=has_time, column=empty_pinned)


def copied(muons: Muons) -> Muons:
    """Return muons of the computer's memory in the GPU's.

    Raises
    ------
    RefusedError
        If it does not hold them.
    """
    import cupy

    try:
        return Muons(**{name: cupy.asarray(column) for name, column in muons.columns.items()})
    except MemoryError as error:
        raise RefusedError(_no_room(len(muons))) from error


def _no_room(n: int) -> str:
    return f"{n} muons do not fit in the GPU's memory: take them in several times, with first="
