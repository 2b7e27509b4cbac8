"""Muons through a slab of matter: the program of one Geant4 process.

``python -m deepmuon_training.geant4_slab FOLDER START STOP STEP``, as `deepmuon_training.geant4_processes`
runs it, carries the chunks range(START, STOP, STEP) of the job in a folder.

Physics: Geant4's standard electromagnetic processes of the muon (ionisation, bremsstrahlung, pair
production, multiple and single Coulomb scattering) and its decay. They compute their own tables, so no
Geant4 data set is needed. Muon-nuclear interaction is left out. Only the muon is followed: its secondaries
are killed as they are born.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import geant4_pybind as g4
import numpy as np
from numpy.typing import NDArray

from deepmuon_training.geant4_processes import CHUNK, EXIT, PRIMARY, SlabJob, chunk_file

__all__ = ["SlabKernel", "main"]

_MUONS_PER_EVENT = 2000  # what Python does per event then costs nothing
_HALF_WIDTH = 50 * g4.km  # as good as infinite: a muon of 100 TeV goes some 20 km
_ENTRY_DEPTH = 1e-6 * g4.mm  # primaries start this far under the upper plane, clear of the boundary

_PRODUCTION_CUT = 100 * g4.mm
"""Secondaries of shorter range are part of the muon's continuous loss. A cut of 1 mm gives the same mean energy
(10 GeV muons through 10 m of water: 7.519 +- 0.001 and 7.521 +- 0.005 GeV) and scattering angle within 1 %,
at a tenth of the speed."""

_STEP_OVER_RANGE, _FINAL_RANGE = 0.02, 10 * g4.mm
"""Steps are this fraction of the muon's range, until that is short. With Geant4's own 0.2 a 10 GeV muon
crosses 10 m of water in two or three steps, and its scattering angle comes out 4 % too small."""


class SlabKernel:
    """Geant4 made ready for one slab (at most once in a process).

    Parameters
    ----------
    job : SlabJob
        The slab.
    """

    def __init__(self, job: SlabJob) -> None:
        self._recorder = _ExitRecorder()
        self._manager = g4.G4RunManagerFactory.CreateRunManager(g4.G4RunManagerType.SerialOnly)
        # Geant4 holds bare pointers to these: they live as long as the kernel.
        self._slab, self._physics = _Slab(job, self._recorder), _MuonPhysics()
        self._actions = _Actions(job, self._recorder)
        for part in (self._slab, self._physics, self._actions):
            self._manager.SetUserInitialization(part)
        g4.G4EmParameters.Instance().SetStepFunctionMuHad(_STEP_OVER_RANGE, _FINAL_RANGE)
        self._manager.Initialize()
        # A cut set in the physics list has no effect here.
        g4.G4UImanager.GetUIpointer().ApplyCommand(f"/run/setCut {_PRODUCTION_CUT / g4.mm} mm")

    def carry(self, primaries: NDArray[np.void], seed: int) -> NDArray[np.void]:
        """Return the muons (EXIT [m]) that leave the slab, of those (PRIMARY [n]) that enter it, in order."""
        self._recorder.exits = []
        self._actions.primaries.muons = primaries
        g4.G4Random.setTheSeed(seed)
        self._manager.BeamOn(-(-len(primaries) // _MUONS_PER_EVENT))
        exits = np.array(self._recorder.exits, EXIT)
        return exits[np.argsort(exits["row"])]


class _Slab(g4.G4VUserDetectorConstruction):
    """A slab around z = 0 in a sensitive vacuum: whatever leaves the slab is seen there."""

    def __init__(self, job: SlabJob, recorder: _ExitRecorder) -> None:
        super().__init__()
        self.job, self.recorder = job, recorder

    def Construct(self) -> g4.G4VPhysicalVolume:  # noqa: N802
        self.volumes: list[g4.G4LogicalVolume | g4.G4VPhysicalVolume] = []  # kept from Python's garbage collection
        world = self.box("world", "G4_Galactic", margin=1 * g4.m, mother=None)
        self.box("slab", self.job.material, margin=0, mother=world.GetLogicalVolume())
        return world

    def box(self, name: str, material: str, margin: float, mother: g4.G4LogicalVolume | None) -> g4.G4VPhysicalVolume:
        side, half = _HALF_WIDTH + margin, self.job.thickness / 2 * g4.m + margin
        stuff = g4.G4NistManager.Instance().FindOrBuildMaterial(material)
        if stuff is None:
            sys.exit(f"Geant4 knows no material {material}")
        logical = g4.G4LogicalVolume(g4.G4Box(name, side, side, half), stuff, name)
        placed = g4.G4PVPlacement(None, g4.G4ThreeVector(), logical, name, mother, False, 0)
        self.volumes += [logical, placed]
        return placed

    def ConstructSDandField(self) -> None:  # noqa: N802
        g4.G4SDManager.GetSDMpointer().AddNewDetector(self.recorder)
        self.SetSensitiveDetector("world", self.recorder)


class _ExitRecorder(g4.G4VSensitiveDetector):
    """Writes down each muon as it steps out of the slab, and ends it there."""

    def __init__(self) -> None:
        super().__init__("exits")
        self.first_row = 0  # of the current event
        self.exits: list[tuple[int, float, float, float, float]] = []  # as in EXIT

    def ProcessHits(self, step: g4.G4Step, history: g4.G4TouchableHistory) -> bool:  # noqa: N802
        track, boundary = step.GetTrack(), step.GetPreStepPoint()
        row = self.first_row + track.GetTrackID() - 1
        direction = boundary.GetMomentumDirection()
        self.exits.append((row, boundary.GetKineticEnergy() / g4.GeV, direction.x, direction.y, direction.z))
        track.SetTrackStatus(g4.fStopAndKill)
        return True


class _MuonPhysics(g4.G4VModularPhysicsList):
    """Electromagnetic physics and decay, of muons only."""

    def __init__(self) -> None:
        super().__init__()
        for constructor in (g4.G4EmStandardPhysics(), g4.G4DecayPhysics(), _MuonsOnly("muons only")):
            self.RegisterPhysics(constructor)


class _MuonsOnly(g4.G4VPhysicsConstructor):
    """Takes from all other particles every process but transportation: some would ask for data sets."""

    def ConstructParticle(self) -> None:  # noqa: N802
        """Construct nothing: the other constructors have done it."""

    def ConstructProcess(self) -> None:  # noqa: N802
        table = g4.G4ParticleTable.GetParticleTable()
        for particle in [table.GetParticle(index) for index in range(table.entries())]:
            manager = particle.GetProcessManager()
            if manager is None or particle.GetParticleName() in ("mu-", "mu+"):
                continue
            for process in list(manager.GetProcessList()):
                if process.GetProcessName() != "Transportation":
                    manager.RemoveProcess(process)


class _Actions(g4.G4VUserActionInitialization):
    def __init__(self, job: SlabJob, recorder: _ExitRecorder) -> None:
        super().__init__()
        self.job, self.recorder = job, recorder

    def Build(self) -> None:  # noqa: N802
        self.primaries, self.no_secondaries = _Primaries(self.job, self.recorder), _NoSecondaries()
        self.SetUserAction(self.primaries)
        self.SetUserAction(self.no_secondaries)


class _Primaries(g4.G4VUserPrimaryGeneratorAction):
    """Shoots the muons of a chunk."""

    def __init__(self, job: SlabJob, recorder: _ExitRecorder) -> None:
        super().__init__()
        self.muons: NDArray[np.void] = np.empty(0, PRIMARY)
        self.recorder = recorder
        self.parent = os.getppid()
        self.guns = {pdg_id: g4.G4ParticleGun(1) for pdg_id in (13, -13)}
        entry = g4.G4ThreeVector(0, 0, job.thickness / 2 * g4.m - _ENTRY_DEPTH)
        for pdg_id, gun in self.guns.items():
            gun.SetParticleDefinition(g4.G4ParticleTable.GetParticleTable().FindParticle(pdg_id))
            gun.SetParticlePosition(entry)

    def GeneratePrimaries(self, event: g4.G4Event) -> None:  # noqa: N802
        if os.getppid() != self.parent:  # who wanted the muons is gone
            os._exit(1)
        self.recorder.first_row = first = event.GetEventID() * _MUONS_PER_EVENT
        for energy, u, v, w, pdg_id in self.muons[first : first + _MUONS_PER_EVENT].tolist():
            gun = self.guns[pdg_id]
            gun.SetParticleEnergy(energy * g4.GeV)
            gun.SetParticleMomentumDirection(g4.G4ThreeVector(u, v, w))
            gun.GeneratePrimaryVertex(event)


class _NoSecondaries(g4.G4UserStackingAction):
    def ClassifyNewTrack(self, track: g4.G4Track) -> g4.G4ClassificationOfNewTrack:  # noqa: N802
        return g4.fUrgent if track.GetParentID() == 0 else g4.fKill


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
        unfinished = folder / f"unfinished-{chunk}.npy"
        np.save(unfinished, exits)
        unfinished.replace(chunk_file(folder, chunk))
    sys.stdout.flush()
    os._exit(0)  # the interpreter may crash while it takes Geant4 down


if __name__ == "__main__":
    main(Path(sys.argv[1]), range(*map(int, sys.argv[2:])))
