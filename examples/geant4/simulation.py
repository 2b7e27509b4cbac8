"""A block of water that muons cross, in Geant4: the program of one process.

``python simulation.py SCENE.json RESULT.npz``, as `tank.py` runs it: Geant4 allows one run manager per process.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import geant4_pybind as g4
import numpy as np
from volumes import Volumes

from deepmuon_runtime import Generator, Muons
from deepmuon_training.transport.geant4_physics import MuonPhysics, NoSecondaries, initialize
from deepmuon_training.transport.geant4_source import MuonSource

EXIT_COLUMNS = ("x0", "y0", "u0", "v0", "w0", "x", "y", "z", "u", "v", "w", "energy")
"""Of a muon that leaves the block: place [m] and direction at the start and at the end, kinetic energy [GeV]."""


@dataclass(frozen=True)
class Scene:
    """A block of water around the origin, muons from all over its top, and maybe a sphere of lead in its middle."""

    depth: float  # m of water above the block, of the released model that the muons are drawn from
    width: float  # m, of the block along x and y
    height: float  # m, of the block
    radius: float  # m, of the sphere, 0 for none
    muons: int
    seed: int
    least_energy: float = 0.0  # GeV; muons with less E |w| are not shot


def run(scene: Scene) -> dict[str, object]:
    """Shoot the muons of a scene; return those that left the block, and the seconds of computing it took."""
    exits = ExitRecorder()
    manager = g4.G4RunManagerFactory.CreateRunManager(g4.G4RunManagerType.SerialOnly)
    parts = [Block(scene, exits), MuonPhysics(), Actions(scene)]  # Geant4 holds bare pointers to these
    for part in parts:
        manager.SetUserInitialization(part)
    initialize(manager)
    g4.G4Random.setTheSeed(scene.seed)
    started = time.process_time()
    manager.BeamOn(scene.muons)  # the source ends the run when no muon is left
    seconds = time.process_time() - started
    rows = np.array(exits.rows).reshape(-1, len(EXIT_COLUMNS))
    return {"seconds": seconds, **dict(zip(EXIT_COLUMNS, rows.T, strict=True))}


def drawn_muons(scene: Scene) -> Iterator[Muons]:
    """Yield the muons of a scene in pieces, from the released model of its depth."""
    left = scene.muons
    for muons in Generator.open(scene.depth, threads=1).chunks(2**53, seed=scene.seed):
        kept = muons[muons.kinetic_energy * muons.cos_zenith >= scene.least_energy][:left]
        yield kept
        left -= len(kept)
        if not left:
            return


class Actions(g4.G4VUserActionInitialization):
    """Where muons come from, and what is not followed."""

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        self.scene = scene

    def Build(self) -> None:  # noqa: N802
        """Make them; Geant4 calls this."""
        scene = self.scene
        area = (scene.width, scene.width)
        just_inside = scene.height / 2 - 1e-9
        self.source = MuonSource(drawn_muons(scene), height=just_inside, area=area, muons_per_event=1000)
        self.no_secondaries = NoSecondaries()
        self.SetUserAction(self.source)
        self.SetUserAction(self.no_secondaries)


class Block(Volumes):
    """The block in a sensitive vacuum, which sees what leaves it."""

    def __init__(self, scene: Scene, exits: ExitRecorder) -> None:
        super().__init__()
        self.scene, self.exits = scene, exits

    def Construct(self) -> g4.G4VPhysicalVolume:  # noqa: N802
        """Build it; Geant4 calls this."""
        side, half = self.scene.width / 2 * g4.m, self.scene.height / 2 * g4.m
        margin = 1 * g4.m
        world = self.place(g4.G4Box("world", side + margin, side + margin, half + margin), "G4_Galactic", None)
        block = self.place(g4.G4Box("block", side, side, half), "G4_WATER", world)
        if self.scene.radius:
            self.place(g4.G4Orb("sphere", self.scene.radius * g4.m), "G4_Pb", block)
        return world

    def ConstructSDandField(self) -> None:  # noqa: N802
        """Make the vacuum sensitive; Geant4 calls this."""
        g4.G4SDManager.GetSDMpointer().AddNewDetector(self.exits)
        self.SetSensitiveDetector("world", self.exits)


class ExitRecorder(g4.G4VSensitiveDetector):
    """Writes down each muon that leaves the block, and ends it there."""

    def __init__(self) -> None:
        super().__init__("exits")
        self.rows: list[tuple[float, ...]] = []  # EXIT_COLUMNS

    def ProcessHits(self, step: g4.G4Step, history: g4.G4TouchableHistory) -> bool:  # noqa: N802
        """Note where a muon came from and where it left; Geant4 calls this."""
        track, boundary = step.GetTrack(), step.GetPreStepPoint()
        start, into = track.GetVertexPosition(), track.GetVertexMomentumDirection()
        end, out = boundary.GetPosition(), boundary.GetMomentumDirection()
        places = (start.x / g4.m, start.y / g4.m, into.x, into.y, into.z, end.x / g4.m, end.y / g4.m, end.z / g4.m)
        self.rows.append((*places, out.x, out.y, out.z, boundary.GetKineticEnergy() / g4.GeV))
        track.SetTrackStatus(g4.fStopAndKill)
        return True


if __name__ == "__main__":
    result = run(Scene(**json.loads(Path(sys.argv[1]).read_text())))
    np.savez(sys.argv[2], **result)
    os._exit(0)  # the interpreter may crash while it takes Geant4 down
