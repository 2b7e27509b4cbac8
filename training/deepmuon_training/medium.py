"""The overburden's name: Geant4's in samples and muon files, `water` or `rock` in models."""

from __future__ import annotations

import re

__all__ = ["density", "geant4_medium", "model_medium"]

_NAMES = {"water": "G4_WATER", "rock": "standard_rock 2.65 g/cm3"}
_STATED = re.compile(r" (\S+) g/cm3$")


def model_medium(medium: str) -> str:
    """Return what a model says of a sample's medium, as `deepmuon_training.transport.material.medium` names it.

    Examples
    --------
    >>> model_medium("G4_WATER"), model_medium("standard_rock 2.65 g/cm3"), model_medium("G4_WATER 1.025 g/cm3")
    ('water', 'rock', 'G4_WATER 1.025 g/cm3')
    """
    if medium == "standard_rock":
        return "rock"
    return {name: short for short, name in _NAMES.items()}.get(medium, medium)


def geant4_medium(medium: str) -> str:
    """Return the sample's name of what a model says its medium is: muons that it gave are a sample again.

    Examples
    --------
    >>> geant4_medium("water"), geant4_medium("G4_CONCRETE")
    ('G4_WATER', 'G4_CONCRETE')
    """
    return _NAMES.get(medium, medium)


def density(medium: str) -> float:
    """Return the density [g/cm3] that a medium's name states, or that of water.

    Examples
    --------
    >>> density("G4_WATER"), density("standard_rock 2.65 g/cm3"), density("G4_CONCRETE")
    (1.0, 2.65, 1.0)
    """
    stated = _STATED.search(geant4_medium(model_medium(medium)))
    return 1.0 if stated is None else float(stated[1])
