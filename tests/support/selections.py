"""What is asked of a device that makes muons: cuts and targets of each kind."""

from __future__ import annotations

from typing import Any

from deepmuon_runtime import Box, Cuts, Cylinder, Plane, Sphere
from support.ball import Ball

__all__ = ["SELECTIONS"]

SELECTIONS: list[dict[str, Any]] = [
    {"cuts": Cuts(energy_min=1, energy_max=5)},
    {"cuts": Cuts(energy_min=1000)},
    {"cuts": Cuts(zenith_min=30, zenith_max=60)},
    {"cuts": Cuts(zenith_max=5)},
    {"target": Plane(2, 3)},
    {"target": Sphere(1.5)},
    {"target": Sphere(1.5), "cuts": Cuts(energy_max=2)},
    {"target": Box(4, 4, 3)},
    {"target": Box(0.1, 5, 5), "cuts": Cuts(energy_min=1, zenith_min=20)},
    {"target": Cylinder(1, 5), "cuts": Cuts(energy_max=2, zenith_max=70)},
    {"target": Ball(1.0, 1.3)},
]
"""Arguments of `Generator.sample`."""
