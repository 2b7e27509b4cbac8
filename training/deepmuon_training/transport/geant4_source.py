"""DeepMuon's muons as the primaries of a Geant4 simulation in Python.

Importing this module imports `geant4_pybind`; `deepmuon_training.transport.geant4_data.without_data_sets` says what to
do first where Geant4's data sets are not installed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice, repeat
from typing import Any

import geant4_pybind as g4

from deepmuon_runtime.muon_file.format import COLUMNS, PLACE
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons

__all__ = ["MuonSource"]


class MuonSource(g4.G4VUserPrimaryGeneratorAction):
    """Shoots muons from where they hit their target, or from a horizontal plane that they cross downwards: z is up.

    Muons stay in their order. Those of a target start at its surface, where they are. Those that have no places are
    spread evenly over a horizontal rectangle, by Geant4's own random numbers, so that Geant4's seed decides where.
    Muons with times start at them. When no muon is left the run is ended after an empty event: `BeamOn` may ask for
    more events than there are.

    Parameters
    ----------
    muons : Muons or iterable of Muons
        What to shoot: an array, or pieces of a stream such as `deepmuon_runtime.Generator.chunks` makes.
    height : float
        Where the centre of the target lies, or the rectangle, z in m.
    area : (float, float) or None
        Its widths along x and y in m, with the centre at x = y = 0; a width of 0 is a line or a point. None for muons
        that have places.
    muons_per_event : int
        Muons of one event. Python's calls per event cost less with many, where it doesn't matter which came together.

    Raises
    ------
    ValueError
        While muons are shot, if they have places and an area is given, or neither.

    Attributes
    ----------
    first : int
        Number of the current event's first muon, among those loaded, from 0. Its track has the ID 1.
    shot : int
        Muons shot so far.

    Examples
    --------
    In `G4VUserActionInitialization.Build`, an hour of muons in a tile of 1 m x 1 m under 40 m of water, with times::

        muons = Generator.open(depth=40).chunks(live_time=3600, target=Plane(1, 1), seed=1)
        self.source = MuonSource(muons)  # Geant4 holds a bare pointer: keep it
        self.SetUserAction(self.source)

    Muons at the same depth above an area of 30 m x 30 m, without times::

        muons = Generator.open(depth=40).chunks(1_000_000, seed=1)
        self.source = MuonSource(muons, height=5.0, area=(30.0, 30.0))
    """

    def __init__(
        self,
        muons: Muons | Iterable[Muons],
        *,
        height: float = 0.0,
        area: tuple[float, float] | None = None,
        muons_per_event: int = 1,
    ) -> None:
        super().__init__()
        self._height = height
        self._area = area
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
        self._rows = chain.from_iterable(map(self._shots, pieces))
        self.first = self.shot = 0

    def GeneratePrimaries(self, event: g4.G4Event) -> None:  # noqa: N802
        """Shoot the muons of one event; Geant4 calls this."""
        self.first = self.shot
        for energy, u, v, w, pdg_id, (x, y, z), time in islice(self._rows, self._muons_per_event):
            gun = self._guns[pdg_id]
            gun.SetParticleEnergy(energy * g4.GeV)
            gun.SetParticleMomentumDirection(g4.G4ThreeVector(u, v, w))
            gun.SetParticlePosition(g4.G4ThreeVector(x * g4.m, y * g4.m, (z + self._height) * g4.m))
            gun.SetParticleTime(time * g4.s)
            gun.GeneratePrimaryVertex(event)
            self.shot += 1
        if self.shot == self.first:
            g4.G4RunManager.GetRunManager().AbortRun(True)  # after this event

    def _shots(self, muons: Muons) -> Iterator[tuple[Any, ...]]:
        """Return the numbers of each muon, and its place [m] and time [s]."""
        if (muons.x is None) == (self._area is None):
            raise ValueError("an area is for muons that have no places: give it to them, and to no others")
        lists = {name: column.tolist() for name, column in muons.columns.items()}
        places = self._places() if self._area is not None else zip(*(lists[name] for name in PLACE), strict=True)
        times = lists.get("time", repeat(0.0))
        return zip(*(lists[name] for name in COLUMNS), places, times, strict=False)  # places and times may have no end

    def _places(self) -> Iterator[tuple[float, float, float]]:
        """Go on for ever with places on the rectangle."""
        assert self._area is not None
        while True:
            x, y = (width * (g4.G4UniformRand() - 0.5) if width else 0.0 for width in self._area)
            yield x, y, 0.0
