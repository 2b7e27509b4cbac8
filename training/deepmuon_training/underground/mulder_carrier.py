"""Mulder: how a muon of a depth came there from the surface, and the energies that matter takes from it on average.

Mulder is LGPL-3, by V. Niess, and stands on his PUMAS (arXiv:2206.01457); the backward method is that of
arXiv:1705.05636. It computes tables of a material when it first meets it, for a quarter of a
minute, and keeps them in ~/.cache/mulder, or where MULDER_CACHE says; nothing is downloaded.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.underground.overburden import Overburden

__all__ = ["DISCRETE", "MIXED", "Origins", "Ranges", "carry_back", "ranges"]

DISCRETE, MIXED = "discrete", "mixed"
"""Modes of mulder: in the first muons scatter. In both, radiative losses and hard collisions are single events."""

_MATERIALS = {"water": "DeepMuonWater", "rock": "Rock"}

_WATER = {"density": 1000.0, "I": 78e-9, "composition": {"H": 0.111907, "O": 0.888093}}
"""Water as in Geant4, with a mean excitation energy of 78 eV: mulder's own has 69 eV, and 1.02 g/cm3."""

_AT_SURFACE = 1e-3  # m; mulder ends a muon at altitude 0 but for rounding

_TABULATED = (1e-3, 1e9)  # GeV

Float = NDArray[np.float64]


class Origins(NamedTuple):
    """What muons of a depth were at the surface; as many as were asked for.

    Parameters
    ----------
    energy, cos_zenith
        Kinetic energy [GeV] and cos zenith there; 1 for a muon that came from nowhere.
    weight
        By which the flux there is to be multiplied to give the flux at the depth, on average; 0 for such a muon.
    """

    energy: Float
    cos_zenith: Float
    weight: Float


def carry_back(overburden: Overburden, mode: str, depth: float, energy: Float, cos_zenith: Float, seed: int) -> Origins:
    """Carry muons from a depth [m] back to the surface.

    Parameters
    ----------
    overburden
        Between the two.
    mode
        `DISCRETE` or `MIXED`.
    depth
        Metres of it.
    energy, cos_zenith
        Of the muons at the depth: kinetic energy [GeV], and cosine of the zenith angle.
    seed
        0 to 2^64 - 1; the same seed gives the same origins.
    """
    meter = _fluxmeter(overburden, mode)
    meter.random.seed = seed
    elevation = np.degrees(np.arcsin(cos_zenith))
    found = meter.transport(energy=energy, elevation=elevation, altitude=-depth, events=1).array.reshape(-1)
    # Scattered muons can leave upwards; no magnetic field is set, so that the charge does not matter.
    sound = (found["weight"] > 0) & (found["elevation"] > 0) & (np.abs(found["altitude"]) < _AT_SURFACE)
    return Origins(
        np.where(sound, found["energy"], 1.0),
        np.where(sound, np.sin(np.radians(found["elevation"])), 1.0),
        np.where(sound, found["weight"], 0.0),
    )


class Ranges:
    """Energies before and after some metres of an overburden, if all losses were the mean ones."""

    def __init__(self, overburden: Overburden) -> None:
        compiled = _fluxmeter(overburden, MIXED).physics.compile(_MATERIALS[overburden.name])
        self._compiled, self._scale = compiled, overburden.density / overburden.own_density

    def before(self, energy: Float, metres: Float) -> Float:
        """Return the kinetic energy [GeV] before so many metres after which it is this; inf above 1 EeV."""
        way = self._compiled.range(energy) + metres * self._scale
        longest = float(self._compiled.range(_TABULATED[1]))
        before: Float = self._compiled.inverse_range(np.minimum(way, longest))
        return np.where(way < longest, before, np.inf)

    def loss(self, energy: Float) -> Float:
        """Return the mean energy loss [GeV/m] at a kinetic energy [GeV]."""
        loss: Float = self._compiled.stopping_power(np.minimum(energy, _TABULATED[1])) * self._scale
        return loss


@lru_cache
def ranges(overburden: Overburden) -> Ranges:
    """Return the ranges of an overburden."""
    return Ranges(overburden)


@lru_cache
def _fluxmeter(overburden: Overburden, mode: str) -> Any:
    """Return mulder's fluxmeter under an overburden.

    Raises
    ------
    RefusedError
        If mulder is not installed.
    """
    try:
        import mulder
        from mulder.materials import Material
    except ImportError as error:
        raise RefusedError(
            "to carry muons back from a depth, mulder is needed: pip install 'deepmuon-training[mulder]'"
        ) from error
    mulder.config.NOTIFY = False
    Material.define(_MATERIALS["water"], **_WATER)
    layer = mulder.Layer(0.0, material=_MATERIALS[overburden.name], density=1e3 * overburden.density)
    return mulder.Fluxmeter(layer, mode=mode)
