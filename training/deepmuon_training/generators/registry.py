"""The architectures by name. A new one is a folder here, and a line."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from deepmuon_runtime.errors import RefusedError

if TYPE_CHECKING:  # which needs torch, and the names alone do not
    from deepmuon_training.generators.architecture import Architecture

__all__ = ["ARCHITECTURES", "architecture"]

ARCHITECTURES = {
    "quantile": "deepmuon_training.generators.quantile.architecture",
    "transformer": "deepmuon_training.generators.transformer.architecture",
}
"""The module of each, whose ARCHITECTURE is its one object."""


def architecture(name: str) -> Architecture[Any, Any]:
    """Return an architecture.

    Raises
    ------
    RefusedError
        If there is none of this name.
    """
    if name not in ARCHITECTURES:
        raise RefusedError(f"there is no architecture {name}, only {' and '.join(ARCHITECTURES)}")
    found: Architecture[Any, Any] = import_module(ARCHITECTURES[name]).ARCHITECTURE
    return found
