"""The flux that was measured: a formula of few parameters, fitted to BESS-TeV and L3+C.

Pions and kaons give muons high in the air, by a power law; on their way down the muons lose energy, and some decay:

    J(E, c) = 1400 A B^-g (f_pi(B, c) + f_K(B, c)) P(E, c) S(B) / S(E)

B is the total energy at birth, f_pi and f_K are Gaisser's factors at the angle of birth
(`deepmuon_training.fluxes.pions_and_kaons`), P is the probability to arrive, and S the energy loss
(`deepmuon_training.fluxes.energy_loss`), whose ratio is that of an interval of energy at birth to what it becomes at
the ground. With the muon's slant depth X = 1033 g/cm2 / c', the depth of birth X_p along it, a constant loss a and an
isothermal atmosphere of scale height h, through which the probability of a decay is a closed integral,

    B = e + a (X - X_p),   P = ((X_p / X) (e / B))^(m h / (c tau c' (e + a X))),   e = (E^3 + E_0^3)^(1/3) + m

The Earth is round: the way grows longer as 1/c' with c'^2 = (c^2 + d^2) / (1 + d^2), and the cosine of the angle of
birth is the same with another d. Both are smooth at the horizon, where the formula of Chirkin that is often used has an
infinite slope. Towards E = 0 the energy e of the arriving muon becomes constant, so that below E_0 the flux goes as
1/S(E), with one angular shape, as it has to: those muons have all but stopped, and came with energies that differ by
little. docs/fluxes.md tells how well it does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deepmuon_training.fluxes.energy_loss import ionisation_loss
from deepmuon_training.fluxes.flux import MUON_MASS, Flux
from deepmuon_training.fluxes.pions_and_kaons import kaon_part, pion_part

__all__ = ["FITTED", "MEASURED", "Parameters", "intensity"]

ATMOSPHERE = 1033.0
"""Depth of the atmosphere at sea level [g/cm2]."""

SCALE_HEIGHT = 8.0e3
"""Of an isothermal atmosphere of 273 K [m]: R T / g."""

DECAY_LENGTH = 658.638
"""Mean life of the muon times the speed of light [m], Particle Data Group 2024."""

WAY, BIRTH = 0.045, 0.12
"""d of the way and of the angle of birth, their cosines at the horizon. They were chosen, see docs/fluxes.md."""

STOPPING_ENERGY = 0.4
"""E_0 [GeV]: below BESS-TeV's first muon, above the 0.3 GeV under which the flux should go as 1/S(E)."""

POSITIVE_KAONS = 0.705
"""Share of mu+ among the muons of kaons, as OPERA measured it (Eur. Phys. J. C 74 (2014) 2933)."""

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Parameters:
    """What is fitted.

    Parameters
    ----------
    level
        A, relative to Gaisser's 0.14 per cm2, s, sr and GeV.
    exponent
        g, of the muons at birth.
    birth_depth
        X_p [g/cm2] along the muon's way. Larger than where most muons are born, since decays weigh it.
    loss
        a [GeV cm2/g] between birth and ground. Larger than by ionisation alone, as it makes up for the rest.
    positive_pions
        Share of mu+ among the muons of pions at high energies.
    neutral_energy, neutral_power
        The excess of mu+ is 1 / (1 + (neutral_energy / B)^neutral_power) of what pions and kaons make at high energies:
        fewer of the primaries of low energy are protons [GeV].
    """

    level: float
    exponent: float
    birth_depth: float
    loss: float
    positive_pions: float
    neutral_energy: float
    neutral_power: float


FITTED = Parameters(
    level=0.75543,
    exponent=2.6618,
    birth_depth=337.69,
    loss=3.3526e-3,
    positive_pions=0.55244,
    neutral_energy=3.4962,
    neutral_power=4.231,
)
"""What ``python -m studies.measured_flux.fit`` prints."""


def intensity(energy: Float, cos_zenith: Float, parameters: Parameters = FITTED) -> tuple[Float, Float]:
    """J of mu+ and of mu- [1/(m2 s sr GeV)].

    Parameters
    ----------
    energy
        Kinetic energy [GeV].
    cos_zenith
        0 to 1; the two broadcast.
    parameters
        Of the formula.
    """
    of = parameters
    path = _bent(cos_zenith, WAY)
    depth = ATMOSPHERE / path
    arriving = np.cbrt(energy**3 + STOPPING_ENERGY**3) + MUON_MASS
    born = arriving + of.loss * (depth - of.birth_depth)
    decays = MUON_MASS * SCALE_HEIGHT / DECAY_LENGTH / (path * (arriving + of.loss * depth))
    arrival = (of.birth_depth / depth * arriving / born) ** decays
    squeezed = ionisation_loss(born) / ionisation_loss(energy)
    common = 1400 * of.level * born**-of.exponent * arrival * squeezed
    cosine = _bent(cos_zenith, BIRTH)
    pions, kaons = pion_part(born, cosine), kaon_part(born, cosine)
    excess = (2 * of.positive_pions - 1) * pions + (2 * POSITIVE_KAONS - 1) * kaons
    excess /= 1 + (of.neutral_energy / born) ** of.neutral_power
    return common * (pions + kaons + excess) / 2, common * (pions + kaons - excess) / 2


def _bent(cos_zenith: Float, at_horizon: float) -> Float:
    """Return a cosine that is 1 for vertical muons, and on a round Earth ends above 0."""
    return np.sqrt((cos_zenith**2 + at_horizon**2) / (1 + at_horizon**2))


MEASURED = Flux("measured", "flux fitted to BESS-TeV (2004) and L3+C (2004)", intensity)
"""Vertical muons as BESS-TeV and L3+C measured them, at all zenith angles."""
