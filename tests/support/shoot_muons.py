"""A Geant4 process that shoots muons and writes down each: shoot_muons.py NUMBER SEED HEIGHT WIDTH_X WIDTH_Y RESULT."""

from __future__ import annotations

import json
import os
import sys
from functools import partial
from pathlib import Path

import geant4_pybind as g4

from deepmuon_runtime import Generator, Plane
from deepmuon_training.transport.geant4_physics import MuonPhysics, initialize
from deepmuon_training.transport.geant4_source import MuonSource


class World(g4.G4VUserDetectorConstruction):
    def Construct(self):  # noqa: N802
        vacuum = g4.G4NistManager.Instance().FindOrBuildMaterial("G4_Galactic")
        self.logical = g4.G4LogicalVolume(g4.G4Box("world", *[10 * g4.m] * 3), vacuum, "world")
        self.placed = g4.G4PVPlacement(None, g4.G4ThreeVector(), self.logical, "world", None, False, 0)
        return self.placed


class Notes(g4.G4UserStackingAction):
    """Writes down each muon, and ends it before its first step."""

    def __init__(self, source):
        super().__init__()
        self.source, self.rows = source, []

    def ClassifyNewTrack(self, track):  # noqa: N802
        place, way = track.GetPosition() / g4.m, track.GetMomentumDirection()
        number = self.source.first + track.GetTrackID() - 1
        pdg_id = track.GetDefinition().GetPDGEncoding()
        energy = track.GetKineticEnergy() / g4.GeV
        self.rows.append([number, pdg_id, energy, way.x, way.y, way.z, place.x, place.y, place.z])
        return g4.fKill


class Actions(g4.G4VUserActionInitialization):
    def __init__(self, source):
        super().__init__()
        self.make_source = source

    def Build(self):  # noqa: N802
        self.source = self.make_source()
        self.notes = Notes(self.source)
        self.SetUserAction(self.source)
        self.SetUserAction(self.notes)


if __name__ == "__main__":
    number, seed = map(int, sys.argv[1:3])
    height, *area = map(float, sys.argv[3:6])
    generator = Generator.open(10, threads=1)
    chunks = generator.chunks(number, seed)
    manager = g4.G4RunManagerFactory.CreateRunManager(g4.G4RunManagerType.SerialOnly)
    source = partial(MuonSource, chunks, height=height, area=area, muons_per_event=1000)
    parts = World(), MuonPhysics(), Actions(source)
    for part in parts:
        manager.SetUserInitialization(part)
    initialize(manager)
    source, notes = parts[-1].source, parts[-1].notes
    result = []
    for _ in range(2):
        g4.G4Random.setTheSeed(1)
        manager.BeamOn(100)
        result.append({"shot": source.shot, "rows": notes.rows})
        notes.rows = []
        source.load(generator.sample(number, seed))
    source.load(generator.sample(1, seed, target=Plane(1, 1)))
    try:
        manager.BeamOn(1)
    except ValueError as error:
        result.append({"refused": str(error)})
    Path(sys.argv[6]).write_text(json.dumps(result))
    os._exit(0)  # the interpreter may crash while it takes Geant4 down
