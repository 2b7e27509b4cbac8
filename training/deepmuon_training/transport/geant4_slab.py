"""Muons through a slab of matter: the program of one Geant4 process.

``python -m deepmuon_training.transport.geant4_slab FOLDER START STOP STEP``, as `geant4_processes` runs it, carries the
chunks range(START, STOP, STEP) of the job in a folder. The physics is that of `geant4_physics`.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import geant4_pybind as g4
import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import Muons
from deepmuon_training.transport.geant4_materials import build_material
from deepmuon_training.transport.geant4_physics import MuonPhysics, NoSecondaries, initialize
from deepmuon_training.transport.geant4_processes import CHUNK, EXIT, SlabJob, chunk_file, sideways_file
from deepmuon_training.transport.geant4_source import MuonSource

__all__ = ["SlabKernel", "main"]

_COLUMNS = ("energy", "u", "v", "w", "pdg_id")  # of PRIMARY, in the order of Muons

_MUONS_PER_EVENT = 2000  # what Python does per event then costs nothing
_INFINITE = 1e5  # m, as good as infinite: a muon of 100 TeV goes some 20 km
_ENTRY_DEPTH = 1e-9  # m; primaries start this far under the upper plane, clear of the boundary

_TOLERANCE = 1e-6 * g4.mm  # a thousand times Geant4's own, of the place of a surface


class SlabKernel:
    """Geant4 made ready for one slab (at most once in a process).

    Parameters
    ----------
    job : SlabJob
        The slab.

    Attributes
    ----------
    sideways : int
        Muons of the last chunk that left the slab by its sides.
    """

    def __init__(self, job: SlabJob) -> None:
        self.sideways = 0
        self._recorder = _ExitRecorder(job.thickness)
        self._manager = g4.G4RunManagerFactory.CreateRunManager(g4.G4RunManagerType.SerialOnly)
        # Geant4 holds bare pointers to these: they live as long as the kernel.
        self._slab, self._physics = _Slab(job, self._recorder), MuonPhysics()
        self._actions = _Actions(job, self._recorder)
        for part in (self._slab, self._physics, self._actions):
            self._manager.SetUserInitialization(part)
        initialize(self._manager)

    def carry(self, primaries: NDArray[np.void], seed: int) -> NDArray[np.void]:
        """Return those (EXIT [m]) of the muons (PRIMARY [n]) that leave the slab by its planes, in their order."""
        self._recorder.exits = []
        self._recorder.sideways = 0
        self._actions.primaries.load(Muons(*(primaries[name] for name in _COLUMNS)))
        g4.G4Random.setTheSeed(seed)
        self._manager.BeamOn(-(-len(primaries) // _MUONS_PER_EVENT))
        self.sideways = self._recorder.sideways
        exits = np.array(self._recorder.exits, EXIT)
        return exits[np.argsort(exits["row"])]


class _Slab(g4.G4VUserDetectorConstruction):
    """A slab around z = 0 in a sensitive vacuum: whatever leaves the slab is seen there."""

    def __init__(self, job: SlabJob, recorder: _ExitRecorder) -> None:
        super().__init__()
        self.job, self.recorder = job, recorder

    def Construct(self) -> g4.G4VPhysicalVolume:  # noqa: N802
        self.volumes: list[g4.G4LogicalVolume | g4.G4VPhysicalVolume] = []  # kept from Python's garbage collection
        vacuum = build_material("G4_Galactic")
        world = self.box("world", vacuum, margin=1 * g4.m, mother=None)
        matter = build_material(self.job.material, self.job.density)
        self.box("slab", matter, margin=0, mother=world.GetLogicalVolume())
        return world

    def box(
        self, name: str, material: g4.G4Material, margin: float, mother: g4.G4LogicalVolume | None
    ) -> g4.G4VPhysicalVolume:
        widths = (*(self.job.box or (_INFINITE, _INFINITE)), self.job.thickness)
        halves = [width / 2 * g4.m + margin for width in widths]
        logical = g4.G4LogicalVolume(g4.G4Box(name, *halves), material, name)
        placed = g4.G4PVPlacement(None, g4.G4ThreeVector(), logical, name, mother, False, 0)
        self.volumes += [logical, placed]
        return placed

    def ConstructSDandField(self) -> None:  # noqa: N802
        g4.G4SDManager.GetSDMpointer().AddNewDetector(self.recorder)
        self.SetSensitiveDetector("world", self.recorder)


class _ExitRecorder(g4.G4VSensitiveDetector):
    """Writes down each muon as it steps out of the slab, and ends it there."""

    source: MuonSource

    def __init__(self, thickness: float) -> None:
        super().__init__("exits")
        self.beside = thickness / 2 * g4.m - _TOLERANCE  # |z| is smaller where a muon leaves by a side
        self.exits: list[tuple[int, float, float, float, float]] = []  # as in EXIT
        self.sideways = 0

    def ProcessHits(self, step: g4.G4Step, history: g4.G4TouchableHistory) -> bool:  # noqa: N802
        track, boundary = step.GetTrack(), step.GetPreStepPoint()
        track.SetTrackStatus(g4.fStopAndKill)
        if abs(boundary.GetPosition().z) < self.beside:
            self.sideways += 1
            return True
        row = self.source.first + track.GetTrackID() - 1
        direction = boundary.GetMomentumDirection()
        self.exits.append((row, boundary.GetKineticEnergy() / g4.GeV, direction.x, direction.y, direction.z))
        return True


class _Actions(g4.G4VUserActionInitialization):
    def __init__(self, job: SlabJob, recorder: _ExitRecorder) -> None:
        super().__init__()
        self.job, self.recorder = job, recorder

    def Build(self) -> None:  # noqa: N802
        self.primaries, self.no_secondaries = _Primaries(self.job), NoSecondaries()
        self.recorder.source = self.primaries
        self.SetUserAction(self.primaries)
        self.SetUserAction(self.no_secondaries)


class _Primaries(MuonSource):
    """Shoots the muons of a chunk, at one place of an infinite slab, uniformly over the upper face of a finite one."""

    def __init__(self, job: SlabJob) -> None:
        height = job.thickness / 2 - _ENTRY_DEPTH
        super().__init__([], height=height, area=job.box or (0.0, 0.0), muons_per_event=_MUONS_PER_EVENT)
        self.parent = os.getppid()

    def GeneratePrimaries(self, event: g4.G4Event) -> None:  # noqa: N802
        if os.getppid() != self.parent:  # who wanted the muons is gone
            os._exit(1)
        super().GeneratePrimaries(event)


def main(folder: Path, chunks: range) -> None:
    """Carry chunks of a job, each into its file, and end the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent as well, which ends this process
    primaries = np.load(folder / "primaries.npy", mmap_mode="r")
    job = SlabJob.read(folder)
    kernel = SlabKernel(job)
    for chunk in chunks:
        first = chunk * CHUNK
        exits = kernel.carry(primaries[first : first + CHUNK], job.chunk_seed(chunk))
        exits["row"] += first
        np.save(sideways_file(folder, chunk), kernel.sideways)
        unfinished = folder / f"unfinished-{chunk}.npy"
        np.save(unfinished, exits)
        unfinished.replace(chunk_file(folder, chunk))
    sys.stdout.flush()
    os._exit(0)  # the interpreter may crash while it takes Geant4 down


if __name__ == "__main__":
    main(Path(sys.argv[1]), range(*map(int, sys.argv[2:])))
