"""What was measured under flat overburdens, and fits to such measurements, as their papers print them.

Left out are values that only came through others' hands with a sign or a digit lost (DUMAND's of 1990, of which the
abstract that is kept has no exponents' signs), sites under mountains, and calculations.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["FITS", "Fit", "Intensity", "Total", "read_intensities", "read_totals"]

FOLDER = Path(__file__).parent

PER_M2 = 1e4
"""cm2 in a m2."""

Float = NDArray[np.float64]


class Intensity(NamedTuple):
    """A vertical intensity and its error [1/(m2 s sr)], at a depth of standard rock."""

    site: str
    depth_kmwe: float
    value: float
    error: float
    source: str


class Total(NamedTuple):
    """A flux and its error [1/(m2 s)] of a surface across the muons' way, of zenith angles down to a cosine."""

    site: str
    depth_kmwe: float
    lowest_cosine: float
    value: float
    error: float
    source: str


class Fit(NamedTuple):
    """A fit to vertical intensities [1/(m2 s sr)] under standard rock, over a range of depths [km w.e.]."""

    name: str
    low: float
    high: float
    source: str

    def __call__(self, depth: Float) -> tuple[Float, Float]:
        """Return the intensity at depths, and its error as its parameters' errors have it."""
        if self.name == "Menon":
            value = 9.8e-7 * PER_M2 * np.exp(-depth / 0.81)
            return value, value * depth / 0.81 * (0.05 / 0.81)
        near, far = 8.60e-6 * PER_M2 * np.exp(-depth / 0.45), 0.44e-6 * PER_M2 * np.exp(-depth / 0.87)
        return near + far, np.hypot(near * 0.53 / 8.60, far * 0.06 / 0.44)


FITS = (
    Fit("Mei and Hime", 1.0, 6.0, "D.-M. Mei and A. Hime, Phys. Rev. D 73 (2006) 053004, equation 1"),
    Fit("Menon", 3.0, 6.0, "M. G. K. Menon et al., Proc. Phys. Soc. 90 (1967) 649"),
)


def read_intensities() -> list[Intensity]:
    """Read intensity.csv."""
    return [
        Intensity(row["site"], float(row["depth_kmwe"]), *_both(row, "intensity"), row["source"])
        for row in _rows("intensity.csv")
    ]


def read_totals() -> list[Total]:
    """Read totals.csv."""
    return [
        Total(row["site"], float(row["depth_kmwe"]), float(row["lowest_cosine"]), *_both(row, "flux"), row["source"])
        for row in _rows("totals.csv")
    ]


def _rows(name: str) -> list[dict[str, str]]:
    lines = (FOLDER / name).read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def _both(row: dict[str, str], name: str) -> tuple[float, float]:
    """Return a value and its error per m2."""
    return PER_M2 * float(row[name]), PER_M2 * float(row["error"])
