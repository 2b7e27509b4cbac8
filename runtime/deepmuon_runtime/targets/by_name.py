"""A target from what a file says of it."""

from __future__ import annotations

from collections.abc import Sequence

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.targets.box import Box
from deepmuon_runtime.targets.cylinder import Cylinder
from deepmuon_runtime.targets.plane import Plane
from deepmuon_runtime.targets.sphere import Sphere
from deepmuon_runtime.targets.target import Target

__all__ = ["NUMBERS", "target_of"]

NUMBERS: dict[type[Target], int] = {Plane: 2, Sphere: 1, Box: 3, Cylinder: 2}
"""How many sizes each target has."""


def target_of(name: str, size: Sequence[float]) -> Target | None:
    """Return the target of a name and sizes; None if it is none of DeepMuon's own.

    Raises
    ------
    RefusedError
        If it is one, and can't have these sizes.
    """
    kind = next((kind for kind in NUMBERS if kind.name == name), None)
    if kind is None:
        return None
    if len(size) != NUMBERS[kind]:
        raise RefusedError(f"a {name} has {NUMBERS[kind]} sizes, and {len(size)} are given")
    return kind(*size)
