"""Solids of a material, one in the other: what the geometries of both examples are made of."""

from __future__ import annotations

import geant4_pybind as g4


class Volumes(g4.G4VUserDetectorConstruction):
    """A geometry whose volumes are all centred on the origin."""

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[object] = []  # from Python's garbage collection: Geant4 holds bare pointers

    def place(self, solid: g4.G4VSolid, material: str, mother: g4.G4VPhysicalVolume | None) -> g4.G4VPhysicalVolume:
        """Put a solid of a material into the middle of its mother volume."""
        name, matter = solid.GetName(), g4.G4NistManager.Instance().FindOrBuildMaterial(material)
        logical = g4.G4LogicalVolume(solid, matter, name)
        outside = mother.GetLogicalVolume() if mother else None
        placed = g4.G4PVPlacement(None, g4.G4ThreeVector(), logical, name, outside, False, 0)
        self.kept += [logical, placed]
        return placed
