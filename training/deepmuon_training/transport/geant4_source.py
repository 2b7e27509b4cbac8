"""DeepMuon's muons as the primaries of a Geant4 simulation in Python.

Importing this module imports `geant4_pybind`; `deepmuon_training.transport.geant4_data.without_data_sets` says what to
do first where Geant4's data sets are not installed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice
from typing import Any

import geant4_pybind as g4

from deepmuon_runtime.muon_file.format import COLUMNS
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons

__all__ = ["MuonSource"]


class MuonSource(g4.G4VUserPrimaryGeneratorAction):
    """Shoots muons from a horizontal plane, of which they are downward crossings: z is up.

    Muons stay in their order. Positions are uniform over the plane, from Geant4's own random numbers, so that Geant4's
    seed decides them. When no muon is left the run is ended after an empty event: `BeamOn` may ask for more events
    than there are.

    Parameters
    ----------
    muons : Muons or iterable of Muons
        What to shoot: an array, or pieces of a stream such as `deepmuon_runtime.Generator.chunks` makes.
    height : float
        Where the plane lies, z in m.
    area : (float, float)
        Its widths along x and y in m, with the centre at x = y = 0; a width of 0 is a line or a point.
    muons_per_event : int
        Muons of one event. Python's calls per event cost less with many, where it doesn't matter which came together.

    Attributes
    ----------
    first : int
        Number of the current event's first muon, among those loaded, from 0. Its track has the ID 1.
    shot : int
        Muons shot so far.

    Examples
    --------
    In `G4VUserActionInitialization.Build`, muons forty metres under water above an area of 30 m x 30 m::

        muons = Generator.open(depth=40).chunks(1_000_000, seed=1)
        self.source = MuonSource(muons, height=5.0, area=(30.0, 30.0))  # Geant4 holds a bare pointer: keep it
        self.SetUserAction(self.source)
    """

    def __init__(
        self, muons: Muons | Iterable[Muons], *, height: float, area: tuple[float, float], muons_per_event: int = 1
    ) -> None:
        super().__init__()
        self._height = height * g4.m
        self._widths = [width * g4.m for width in area]
        self._muons_per_event = muons_per_event
        self._guns = {
            MU_MINUS: g4.G4ParticleGun(g4.G4MuonMinus.Definition()),
            MU_PLUS: g4.G4ParticleGun(g4.G4MuonPlus.Definition()),
        }
        self.load(muons)

    def load(self, muons: Muons | Iterable[Muons]) -> None:
        """Go on with other muons, counted from 0.

        Parameters
        ----------
        muons : Muons or iterable of Muons
            As for the class.
        """
        pieces = [muons] if isinstance(muons, Muons) else muons
        self._rows = chain.from_iterable(map(_rows, pieces))
        self.first = self.shot = 0

    def GeneratePrimaries(self, event: g4.G4Event) -> None:  # noqa: N802
        """Shoot the muons of one event; Geant4 calls this."""
        self.first = self.shot
        for energy, u, v, w, pdg_id in islice(self._rows, self._muons_per_event):
            gun = self._guns[pdg_id]
            gun.SetParticleEnergy(energy * g4.GeV)
            gun.SetParticleMomentumDirection(g4.G4ThreeVector(u, v, w))
            gun.SetParticlePosition(self._position())
            gun.GeneratePrimaryVertex(event)
            self.shot += 1
        if self.shot == self.first:
            g4.G4RunManager.GetRunManager().AbortRun(True)  # after this event

    def _position(self) -> g4.G4ThreeVector:
        x, y = (width * (g4.G4UniformRand() - 0.5) if width else 0.0 for width in self._widths)
        return g4.G4ThreeVector(x, y, self._height)


def _rows(muons: Muons) -> Iterator[tuple[Any, ...]]:
    return zip(*(getattr(muons, name).tolist() for name in COLUMNS), strict=True)
