"""The media that muons can be carried back through, and their densities."""

from __future__ import annotations

from dataclasses import dataclass

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.transport.material import DENSITIES, STANDARD_ROCK, STANDARD_ROCK_DENSITY, medium

__all__ = ["OVERBURDENS", "Overburden", "overburden"]


@dataclass(frozen=True)
class Overburden:
    """What lies above a depth, infinitely wide, its upper plane at sea level.

    Parameters
    ----------
    name
        water or rock (Z = 11, A = 22), as models call it.
    geant4_name
        What samples call its material.
    own_density
        Density [g/cm3] for which mulder computes its density effect.
    density
        Its density [g/cm3].
    """

    name: str
    geant4_name: str
    own_density: float
    density: float

    @property
    def medium(self) -> str:
        """What a sample says of it."""
        return medium(self.geant4_name, None if self.density == self.own_density else self.density)

    def water_equivalent(self, depth: float) -> float:
        """Return a depth [m] in m of water equivalent, 0.1 kg/cm2."""
        return depth * self.density


OVERBURDENS = {
    "water": Overburden("water", "G4_WATER", 1.0, 1.0),
    "rock": Overburden("rock", STANDARD_ROCK, STANDARD_ROCK_DENSITY, STANDARD_ROCK_DENSITY),
}
"""By name, at their own densities."""


def overburden(name: str, density: float | None = None) -> Overburden:
    """Return an overburden by its name, at a density [g/cm3] of one's own if one is given.

    Raises
    ------
    RefusedError
        If it is neither water nor rock, or the density is not one of matter.

    Examples
    --------
    >>> overburden("rock", 2.8).medium, overburden("water").medium
    ('standard_rock 2.8 g/cm3', 'G4_WATER')
    """
    if name not in OVERBURDENS:
        raise RefusedError(f"the medium {name!r} is unknown here: expected was {' or '.join(OVERBURDENS)}")
    own = OVERBURDENS[name]
    if density is None:
        return own
    if density not in DENSITIES:
        raise RefusedError(f"a density of {density:g} g/cm3: it should be {DENSITIES}")
    return Overburden(own.name, own.geant4_name, own.own_density, float(density))
