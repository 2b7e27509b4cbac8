"""What an overburden is made of, by name and density."""

from __future__ import annotations

import subprocess
import sys
from difflib import get_close_matches
from functools import cache

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_training.ranges import Range
from deepmuon_training.transport.geant4_data import without_data_sets

__all__ = ["DENSITIES", "STANDARD_ROCK", "STANDARD_ROCK_DENSITY", "check_material", "known_materials", "medium"]

STANDARD_ROCK = "standard_rock"
"""The rock of the muon literature (Z = 11, A = 22), which Geant4 has no name for."""

STANDARD_ROCK_DENSITY = 2.65
"""Its density in g/cm3, unless another is stated."""

DENSITIES = Range(1e-6, 30.0)
"""Of matter, in g/cm3: from a thin gas to the densest metal."""


def medium(name: str, density: float | None) -> str:
    """Return what a sample says of its overburden.

    Parameters
    ----------
    name : str
        Name of the material.
    density : float or None
        Its density in g/cm3, None for the material's own.

    Examples
    --------
    >>> medium("G4_WATER", None), medium("G4_WATER", 1.025), medium("standard_rock", None)
    ('G4_WATER', 'G4_WATER 1.025 g/cm3', 'standard_rock 2.65 g/cm3')
    """
    if name == STANDARD_ROCK:
        density = density or STANDARD_ROCK_DENSITY
    return name if density is None else f"{name} {density:g} g/cm3"


def check_material(name: str, density: float | None) -> None:
    """Refuse what Geant4 can't build.

    Parameters
    ----------
    name, density
        As for `medium`.

    Raises
    ------
    RefusedError
        If there is no such material, or the density is not one of matter.
    """
    if density is not None and density not in DENSITIES:
        raise RefusedError(f"a density of {density:g} g/cm3: it should be {DENSITIES}")
    names = known_materials()
    if name not in names:
        similar = get_close_matches(name, names) or ["G4_WATER", "G4_CONCRETE", STANDARD_ROCK]
        raise RefusedError(f"Geant4 knows no material {name}: there are for instance {', '.join(similar)}")


@cache
def known_materials() -> tuple[str, ...]:
    """Return the names of all materials: asked of Geant4, once, in a process of its own.

    Raises
    ------
    FailedError
        If Geant4 does not start.
    """
    asked = subprocess.run(
        [sys.executable, "-m", "deepmuon_training.transport.geant4_materials"],
        env=without_data_sets(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    if asked.returncode:
        raise FailedError(f"Geant4 did not start, saying: ... {' '.join(asked.stderr.split())[-600:]}")
    return tuple(asked.stdout.split())
