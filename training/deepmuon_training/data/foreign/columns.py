"""What the columns of a table mean, and muons of its rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.data.foreign.muons import CHARGE_UNKNOWN, FEW_DIGITS, foreign_muons, pdg_id_of
from deepmuon_training.data.foreign.particles import MUON_IDS, muon_ids, refuse_others
from deepmuon_training.data.foreign.table import Float, Place
from deepmuon_training.fluxes.flux import MUON_MASS

__all__ = ["ANGLES", "KNOWN", "UNITS", "Columns"]

UNITS = {"eV": 1e-9, "keV": 1e-6, "MeV": 1e-3, "GeV": 1.0, "TeV": 1e3, "PeV": 1e6}
"""GeV in each unit of energy; momenta are in the same over c."""

ANGLES = {"deg": pi / 180, "rad": 1.0}
"""Radian in each unit of angle."""

ENERGY = ("E", "Etot", "p")
COSINES = ("u", "v", "w")
MOMENTUM = ("px", "py", "pz")
POLAR = ("theta", "zenith", "cos_zenith")
AZIMUTH = ("phi", "azimuth")
CHARGE = ("charge", *MUON_IDS)

KNOWN = (*ENERGY, *COSINES, *MOMENTUM, *POLAR, *AZIMUTH, *CHARGE, "weight", "skip")
"""Names of columns; those of `COSINES` and `MOMENTUM` may have a minus before them."""

SQUARE_TOLERANCE = 1e-5
"""By how much u^2 + v^2 of a level muon may be above 1, by rounding."""

SMALLEST_COSINE = 1e-4
"""Cosine of the zenith angle of a muon whose u and v, as they are rounded, leave nothing for w."""

FEW = 10  # muons that say nothing of a unit

DEEPEST_MEDIAN = 1e3  # GeV; under 5 km of water it is near 0.2 TeV

UP = {
    COSINES: "-w is a w whose z axis points down, -u,-v,-w a vector that points to where the muon comes from",
    MOMENTUM: "-pz is a pz whose z axis points down, -px,-py,-pz a vector that points to where the muon comes from",
    POLAR: "zenith is the angle between the vertical and where the muon comes from, theta that from z to its motion",
}
"""What may be meant where muons go up."""


@dataclass(frozen=True)
class Columns:
    """What the columns of a table mean.

    Parameters
    ----------
    names : sequence of str
        For each column, one of

        - E, kinetic energy; Etot, total energy; p, momentum: one of them, unless px, py and pz are there
        - u, v, w: direction of motion, z up. With -u, -v, -w the column holds the opposite: -w in a table whose z axis
          points down. Without w it is the negative root of 1 - u^2 - v^2: muons go down.
        - px, py, pz: momentum; -px, -py, -pz its opposite
        - theta, phi: polar angle and azimuth of the direction of motion, z up: theta is above 90 degrees. zenith (or
          cos_zenith), azimuth: those of where the muon comes from. One of each pair.
        - charge: -1, +1; or a particle's number, in one of `MUON_IDS`
        - weight: for how many muons it stands, in any unit
        - skip: anything else
    unit : str
        Unit of energies and momenta, one of `UNITS`.
    angle : str
        Unit of theta, zenith, phi and azimuth, one of `ANGLES`.

    Raises
    ------
    RefusedError
        If a name is none of these or there twice, or energy or direction are missing or there twice.
    """

    names: Sequence[str]
    unit: str
    angle: str = "rad"

    def __post_init__(self) -> None:
        """Refuse what is no table of muons."""
        for name in self.names:
            if name not in KNOWN and not (name[:1] == "-" and name[1:] in (*COSINES, *MOMENTUM)):
                raise RefusedError(
                    f"there is no column {name!r}: a column is one of {', '.join(KNOWN)}, or -u, -v, -w, -px, -py, -pz"
                )
        for name in self._quantities:
            if self._quantities.count(name) > 1:
                raise RefusedError(f"the column {name} is there twice")
        self._refuse_twice(
            "energy", [*(name for name in ENERGY if self._has(name)), *(["px,py,pz"] if self._any(MOMENTUM) else [])]
        )
        self._refuse_twice("direction", [",".join(kind) for kind in (COSINES, MOMENTUM) if self._any(kind)])
        for kind in (POLAR, AZIMUTH, CHARGE):
            self._refuse_twice(f"{kind[0]}", [name for name in kind if self._has(name)])
        if self._any((*POLAR, *AZIMUTH)):
            self._refuse_twice(
                "direction", ["the angles", *(name for name in (*COSINES, *MOMENTUM) if self._has(name))]
            )
        missing = self._missing()
        if missing:
            raise RefusedError(f"there is no column {missing}")

    def _refuse_twice(self, what: str, names: list[str]) -> None:
        if len(names) > 1:
            raise RefusedError(f"{' and '.join(names)} say the same, the {what}: skip all but one")

    def _missing(self) -> str:
        """Return the columns that are missing, and what for."""
        if self._any(MOMENTUM):
            return " and ".join(name for name in MOMENTUM if not self._has(name))
        if not self._any(ENERGY):
            return "E: a muon needs a kinetic energy E, or Etot, p, or px,py,pz in its place"
        if self._any((*POLAR, *AZIMUTH)):
            return (
                "" if self._any(POLAR) and self._any(AZIMUTH) else "phi: two angles make a direction, as zenith,azimuth"
            )
        lacking = [name for name in ("u", "v") if not self._has(name)]
        return f"{' and '.join(lacking)}: a direction is u,v, or u,v,w, or two angles" if lacking else ""

    @property
    def _quantities(self) -> list[str]:
        return [name.lstrip("-") for name in self.names if name != "skip"]

    def _has(self, name: str) -> bool:
        return name in self._quantities

    def _any(self, names: Sequence[str]) -> bool:
        return not set(names).isdisjoint(self._quantities)

    @property
    def wanted(self) -> list[int]:
        """The positions of those that are not skipped."""
        return [i for i, name in enumerate(self.names) if name != "skip"]

    @property
    def has_charge(self) -> bool:
        """Whether a column says it."""
        return self._any(CHARGE)

    @property
    def has_weight(self) -> bool:
        """Whether a column says it."""
        return self._has("weight")

    @property
    def id_kind(self) -> str | None:
        """Which of `MUON_IDS` says what the particles are, if any does."""
        return next((name for name in MUON_IDS if self._has(name)), None)

    def __str__(self) -> str:
        """Return the names, with their units."""
        return ", ".join(self._named(name) for name in self.names)

    def _named(self, name: str) -> str:
        quantity = name.lstrip("-")
        if quantity in ("E", "Etot"):
            return f"{name} [{self.unit}]"
        if quantity in ("p", *MOMENTUM):
            return f"{name} [{self.unit}/c]"
        return f"{name} [{self.angle}]" if quantity in ("theta", "zenith", *AZIMUTH) else name

    def column(self, name: str, numbers: Float) -> Float:
        """Return one quantity of rows of the `wanted` columns, as if it had no minus: float64 [n]."""
        names = [self.names[i] for i in self.wanted]
        return numbers[:, names.index(name)] if name in names else -numbers[:, names.index(f"-{name}")]

    def muons(self, numbers: Float, place: Place) -> Muons:
        """Make muons of rows; their pdg_id is 0 if no column has the charge.

        Parameters
        ----------
        numbers : float64 [n, wanted]
            The rows of the `wanted` columns.
        place
            Where each stands, for an error.

        Raises
        ------
        RefusedError
            If one can't be a muon.
        """
        pdg_id = self._pdg_id(numbers, place)  # first: what is no muon need not look like one
        return foreign_muons(
            self._kinetic_energy(numbers, place), self._direction(numbers, place), pdg_id, place, hint=self._hint()
        )

    def doubts(self, muons: Muons) -> Iterator[str]:
        """Yield what looks wrong with the units of muons that were read, a question each."""
        if len(muons) < FEW:
            return
        if np.median(muons.kinetic_energy) > DEEPEST_MEDIAN:
            units = list(UNITS)
            smaller = units[max(0, units.index(self.unit) - 1)]
            yield f"half of the muons have more than 1 TeV: are the energies in {smaller}, and not in {self.unit}?"
        if self.angle == "deg" and self._has("zenith") and muons.cos_zenith.min() > np.cos(np.radians(pi / 2)):
            yield "no muon is further from the vertical than 1.6 degrees: are the angles in rad, and not in deg?"

    def _hint(self) -> str:
        return next(hint for kind, hint in UP.items() if kind == POLAR or self._any(kind))

    def _kinetic_energy(self, numbers: Float, place: Place) -> Float:
        factor = UNITS[self.unit]
        if self._has("E"):
            return factor * self.column("E", numbers)
        if self._has("Etot"):
            total = factor * self.column("Etot", numbers)
            _refuse(total < (1 - FEW_DIGITS) * MUON_MASS, total, place, "a total energy of {:g} GeV, below its mass")
            return np.where(total < MUON_MASS, 0.0, total - MUON_MASS)  # NaN stays
        if self._has("p"):
            momentum = factor * self.column("p", numbers)
            _refuse(momentum < 0, momentum, place, "a momentum of {:g} GeV/c, which is negative")
        else:
            momentum = factor * np.linalg.norm(self._vectors(MOMENTUM, numbers), axis=1)
        with np.errstate(over="ignore"):
            square = momentum**2
            return np.where(np.isinf(square), momentum, square / (np.sqrt(square + MUON_MASS**2) + MUON_MASS))

    def _vectors(self, names: Sequence[str], numbers: Float) -> Float:
        return np.stack([self.column(name, numbers) for name in names], axis=1)

    def _direction(self, numbers: Float, place: Place) -> Float:
        if self._any(MOMENTUM):
            momenta = self._vectors(MOMENTUM, numbers)
            with np.errstate(invalid="ignore"):  # no momentum: NaN, which is refused
                directions: Float = momenta / np.linalg.norm(momenta, axis=1, keepdims=True)
            return directions
        if self._has("w"):
            return self._vectors(COSINES, numbers)
        if self._has("u"):
            u, v = self._vectors(("u", "v"), numbers).T
            return np.stack([u, v, _downward(u, v, place)], axis=1)
        sine, w = self._polar(numbers, place)
        of_motion = 1 if self._has("phi") else -1
        with np.errstate(invalid="ignore"):
            phi = ANGLES[self.angle] * self.column("phi" if self._has("phi") else "azimuth", numbers)
            return np.stack([of_motion * sine * np.cos(phi), of_motion * sine * np.sin(phi), w], axis=1)

    def _polar(self, numbers: Float, place: Place) -> tuple[Float, Float]:
        """Return the sine of the polar angle, and w."""
        if self._has("cos_zenith"):
            cosine = self.column("cos_zenith", numbers)
            _refuse(np.abs(cosine) > 1 + SQUARE_TOLERANCE, cosine, place, "a cos_zenith of {:g}")
            cosine = np.clip(cosine, -1, 1)
            return np.sqrt(1 - cosine**2), -cosine
        name = "theta" if self._has("theta") else "zenith"
        angle = self.column(name, numbers)
        largest = pi / ANGLES[self.angle]
        # Of few digits: 3.142 is pi.
        bad = (angle < 0) | (angle > 1.001 * largest)
        advice = ": are the angles in degrees?" if self.angle == "rad" else ""
        _refuse(bad, angle, place, f"a {name} of {{:g}} {self.angle}, which is none of 0 to {largest:.4g}{advice}")
        with np.errstate(invalid="ignore"):
            sine, cosine = np.abs(np.sin(ANGLES[self.angle] * angle)), np.cos(ANGLES[self.angle] * angle)
        return sine, cosine if name == "theta" else -cosine

    def _pdg_id(self, numbers: Float, place: Place) -> NDArray[np.int8] | int:
        if self._has("charge"):
            return pdg_id_of(self.column("charge", numbers), place)
        if self.id_kind is not None:
            ids = self.column(self.id_kind, numbers)
            refuse_others(self.id_kind, ids, place)
            return muon_ids(self.id_kind, ids)
        return CHARGE_UNKNOWN


def _refuse(bad: NDArray[np.bool_], numbers: Float, place: Place, what: str) -> None:
    """Refuse the first bad one of some muons by its number."""
    if bad.any():
        row = int(np.argmax(bad))
        raise RefusedError(f"{place(row)}: the muon has {what.format(numbers[row])}")


def _downward(u: Float, v: Float, place: Place) -> Float:
    """Return the w of unit vectors that go down."""
    with np.errstate(over="ignore"):
        square = u**2 + v**2
    _refuse(square > 1 + SQUARE_TOLERANCE, square, place, "u^2 + v^2 = {:g}, and a direction has 1 at most")
    w: Float = -np.sqrt(np.maximum(1 - square, SMALLEST_COSINE**2))
    return w
