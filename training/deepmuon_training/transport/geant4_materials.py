"""The materials that Geant4 can build: its own (NIST) ones at any density, and standard rock.

``python -m deepmuon_training.transport.geant4_materials`` prints their names, for
`deepmuon_training.transport.material`.
"""

from __future__ import annotations

import math

import geant4_pybind as g4

from deepmuon_training.transport.material import STANDARD_ROCK, STANDARD_ROCK_DENSITY

__all__ = ["build_material"]

_kept: list[g4.G4Element | g4.G4Material] = []  # Geant4 holds bare pointers to what was made here


def build_material(name: str, density: float | None = None) -> g4.G4Material:
    """Return a material, at a density [g/cm3] of one's own if one is given.

    Raises
    ------
    ValueError
        If Geant4 knows no such material.
    """
    own = _standard_rock() if name == STANDARD_ROCK else g4.G4NistManager.Instance().FindOrBuildMaterial(name)
    if own is None:
        raise ValueError(f"Geant4 knows no material {name}")
    return own if density is None else _at_density(own, density * g4.g / g4.cm3)


def _standard_rock() -> g4.G4Material:
    """Return a fictitious element of Z = 11, A = 22, with the constants of the Particle Data Group.

    D. E. Groom, N. V. Mokhov and S. I. Striganov, *Muon stopping power and range tables 10 MeV - 100 TeV*, Atomic Data
    and Nuclear Data Tables 78 (2001) 183: mean excitation energy 136.4 eV, and the parameters of the density effect.
    """
    # Not G4Material's constructor that takes Z and A: it makes sodium (A = 22.99) of it.
    element = g4.G4Element(STANDARD_ROCK, "Rock", 11, 22 * g4.g / g4.mole)
    rock = g4.G4Material(STANDARD_ROCK, STANDARD_ROCK_DENSITY * g4.g / g4.cm3, 1)
    rock.AddElement(element, 1.0)
    c, m, a, x0, x1, delta0 = 3.7738, 3.4120, 0.08301, 0.0492, 3.0549, 0.0
    rock.GetIonisation().SetMeanExcitationEnergy(136.4 * g4.eV)
    rock.GetIonisation().SetDensityEffectParameters(c, m, a, x0, x1, delta0)
    _kept.extend([element, rock])
    return rock


def _at_density(base: g4.G4Material, density: float) -> g4.G4Material:
    """Return a material like another but for its density.

    Its density effect moves as in R. M. Sternheimer, M. J. Berger and S. M. Seltzer, Atomic Data and Nuclear Data
    Tables 30 (1984) 261. Geant4's own BuildMaterialWithNewDensity is not for us: in water of twice the density muons of
    10 GeV lost 16 % too much.
    """
    name = f"{base.GetName()} {density / (g4.g / g4.cm3):g} g/cm3"
    material = g4.G4Material(name, density, base.GetNumberOfElements(), base.GetState())
    for element, fraction in zip(base.GetElementVector(), base.GetFractionVector(), strict=True):
        material.AddElement(element, float(fraction))
    own, changed = base.GetIonisation(), material.GetIonisation()
    thinner = math.log(base.GetDensity() / density)
    shift = thinner / math.log(100)
    changed.SetMeanExcitationEnergy(own.GetMeanExcitationEnergy())
    changed.SetDensityEffectParameters(
        own.GetCdensity() + thinner,
        own.GetMdensity(),
        own.GetAdensity(),
        own.GetX0density() + shift,
        own.GetX1density() + shift,
        own.GetD0density(),
    )
    _kept.append(material)
    return material


if __name__ == "__main__":
    print(STANDARD_ROCK, *g4.G4NistManager.Instance().GetNistMaterialNames(), sep="\n")
