"""Muons that hit a box of water under water, in Geant4: from the library, or from a file of them.

    python examples/geant4/target.py -n 10000
    python examples/geant4/target.py --live-time 10 --box 1 0.05 1 --zenith-min 60
    deepmuon-gen --depth 10 --box 4 4 3 --live-time 10 --seed 1 -o muons.mcpl
    python examples/geant4/target.py --muons muons.mcpl

Every muon starts where it enters the box, and none misses it. Printed are the muons a second that hit the box, that
stop in it, and what they leave in it; -o writes a line for each. A file may be of any format of deepmuon-gen; one of
the same muons gives the same, but for the rounding of its numbers.
"""

from __future__ import annotations

import csv
import math
import os
import sys
from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import click

from deepmuon_runtime import Box, Cuts, Generator, Muons, RefusedError
from deepmuon_runtime.formats.registry import opened_muons
from deepmuon_training.transport.geant4_data import without_data_sets

os.environ.update(without_data_sets())  # before Geant4 is imported

import geant4_pybind as g4
from volumes import Volumes

from deepmuon_training.transport.geant4_physics import MuonPhysics, NoSecondaries, initialize
from deepmuon_training.transport.geant4_source import MuonSource

EVENTS_AT_ONCE = 2**31 - 1  # the most that Geant4 takes; the source ends the run when no muon is left


@dataclass
class Hit:
    """What a muon did in the box."""

    muon: int  # its number, from 0
    time: float  # s, when it came in; 0 where muons have no times
    x: float  # m, where it came in
    y: float
    z: float
    way: float = 0.0  # m, in the box
    lost: float = 0.0  # GeV
    stopped: bool = False


@dataclass(frozen=True)
class Beam:
    """Muons that hit a box, and how many do so a second."""

    box: Box
    rate: float  # Hz
    muons: Iterator[Muons]


@click.command(help=__doc__)
@click.option("-n", "--number", type=int, help="Muons.")
@click.option("--live-time", type=float, metavar="SECONDS", help="Instead of -n: the muons of this time, with times.")
@click.option("--box", nargs=3, type=float, default=(4.0, 4.0, 3.0), show_default=True, help="Its widths in metres.")
@click.option("--depth", default=10.0, show_default=True, metavar="METRES", help="Above the box's centre.")
@click.option("--flux", metavar="NAME", help="Of the released family: cry (if left out) or measured.")
@click.option("--medium", metavar="NAME", help="Of the released family: water (if left out) or rock.")
@click.option("--model", type=click.Path(), help="A family's file, instead of the released one.")
@click.option("--zenith-min", type=float, metavar="DEGREES", help="Muons that come in flatter than this alone.")
@click.option("--seed", default=1, show_default=True)
@click.option("--muons", "file", type=click.Path(), help="A file of muons that hit a box, instead of all of the above.")
@click.option("-o", "--output", type=click.Path(), help="A line of text for each muon.")
def main(file: str | None, output: str | None, **wanted: object) -> None:
    """Simulate, print, and write."""
    try:
        if file is None:
            report(shoot(drawn(**wanted)), output)
        else:
            with opened_muons(file) as source:
                pieces = (Muons(**columns) for columns in source.pieces())
                known = source.attributes
                if known.get("target") != Box.name:
                    raise RefusedError(f"the muons of {file} hit no box: make them with --box X Y Z")
                report(shoot(Beam(Box(*known["target_size_m"]), known["target_rate_hz"], pieces)), output)
    except RefusedError as error:
        raise click.UsageError(str(error)) from error
    sys.stdout.flush()
    os._exit(0)  # the interpreter may crash while it takes Geant4 down


def drawn(number, live_time, box, depth, flux, medium, model, zenith_min, seed) -> Beam:
    """Return muons from the library."""
    generator = Generator.open(depth, flux=flux, medium=medium, file=model)
    which = {"target": Box(*box), "cuts": Cuts(zenith_min=zenith_min)}
    if number is None and live_time is None:
        number = 10_000
    muons = generator.chunks(number, seed, live_time=live_time, **which)
    return Beam(which["target"], generator.rate(**which).hz, muons)


def shoot(beam: Beam) -> tuple[Beam, int, list[Hit]]:
    """Carry the muons through the box; return how many were shot, and what each did in it."""
    manager = g4.G4RunManagerFactory.CreateRunManager(g4.G4RunManagerType.SerialOnly)
    hits = Hits()
    parts = [Detector(beam.box, hits), MuonPhysics(), Actions(beam.muons, hits)]  # Geant4 holds bare pointers to these
    for part in parts:
        manager.SetUserInitialization(part)
    initialize(manager)
    g4.G4Random.setTheSeed(1)
    manager.BeamOn(EVENTS_AT_ONCE)
    return beam, hits.source.shot, list(hits.of_muon.values())


def report(done: tuple[Beam, int, list[Hit]], output: str | None) -> None:
    """Print how often what happens, and write the hits."""
    beam, shot, hits = done
    seconds, stopped = shot / beam.rate, sum(hit.stopped for hit in hits)
    click.echo(f"{shot:,} muons on a box of {' x '.join(f'{width:g}' for width in beam.box.size)} m")
    click.echo(f"{beam.rate:,.1f} a second, and so those of {seconds:.4g} s")
    click.echo(f"entered it: {len(hits):,}")
    click.echo(f"stopped in it: {stopped / seconds:.3g} +- {math.sqrt(stopped) / seconds:.2g} a second")
    if hits:
        way, lost = (sum(getattr(hit, name) for hit in hits) / len(hits) for name in ("way", "lost"))
        click.echo(f"on average, way in it: {way:.3f} m, energy lost there: {lost:.3f} GeV")
    if output is not None:
        with Path(output).open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(field.name for field in fields(Hit))
            rows.writerows(astuple(hit) for hit in hits)


class Detector(Volumes):
    """The box in a vacuum."""

    def __init__(self, box: Box, hits: Hits) -> None:
        super().__init__()
        self.box, self.hits = box, hits

    def Construct(self) -> g4.G4VPhysicalVolume:  # noqa: N802
        """Build it; Geant4 calls this."""
        half = [width / 2 * g4.m for width in self.box.size]
        world = self.place(g4.G4Box("world", *(width + 1 * g4.m for width in half)), "G4_Galactic", None)
        self.place(g4.G4Box("box", *half), "G4_WATER", world)
        return world

    def ConstructSDandField(self) -> None:  # noqa: N802
        """Make the box sensitive; Geant4 calls this."""
        g4.G4SDManager.GetSDMpointer().AddNewDetector(self.hits)
        self.SetSensitiveDetector("box", self.hits)


class Hits(g4.G4VSensitiveDetector):
    """Sums up what each muon does in the box."""

    def __init__(self) -> None:
        super().__init__("hits")
        self.source: MuonSource
        self.of_muon: dict[int, Hit] = {}

    def ProcessHits(self, step: g4.G4Step, history: g4.G4TouchableHistory) -> bool:  # noqa: N802
        """Take a step of a muon in the box; Geant4 calls this."""
        before, after = step.GetPreStepPoint(), step.GetPostStepPoint()
        number = self.source.first + step.GetTrack().GetTrackID() - 1
        hit = self.of_muon.get(number)
        if hit is None:
            place = before.GetPosition()
            where = (place.x / g4.m, place.y / g4.m, place.z / g4.m)
            hit = self.of_muon[number] = Hit(number, before.GetGlobalTime() / g4.s, *where)
        hit.way += step.GetStepLength() / g4.m
        hit.lost += (before.GetKineticEnergy() - after.GetKineticEnergy()) / g4.GeV
        hit.stopped = after.GetKineticEnergy() == 0
        return True


class Actions(g4.G4VUserActionInitialization):
    """Where muons come from, and what is not followed."""

    def __init__(self, muons: Iterator[Muons], hits: Hits) -> None:
        super().__init__()
        self.muons, self.hits = muons, hits

    def Build(self) -> None:  # noqa: N802
        """Make them; Geant4 calls this."""
        self.source = self.hits.source = MuonSource(self.muons, muons_per_event=100)
        self.no_secondaries = NoSecondaries()
        self.SetUserAction(self.source)
        self.SetUserAction(self.no_secondaries)


if __name__ == "__main__":
    main()
