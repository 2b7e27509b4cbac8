"""A user's own flux: a table of J over kinetic energy and cos zenith, between whose lines it goes as a power."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_training.fluxes.flux import Flux, Intensity

__all__ = ["read_flux_table"]

COLUMNS = "energy in GeV, cos zenith, flux of mu+, flux of mu-"

LEVEL = 0.05
"""cos zenith below which, about, the logarithm of the flux is linear in cos zenith; above it is in its logarithm."""

SHOWN = 60  # characters of a bad line in its error

Float = NDArray[np.float64]


def read_flux_table(path: str | Path) -> Flux:
    """Read a flux from a text of four numbers a line, with commas or blanks between them.

    Each line is kinetic energy [GeV], cos zenith, and the J of mu+ and mu- [1/(m2 s sr GeV)]. For each cos zenith in
    turn, rising or falling and with 1 among them, come the same energies, rising. Empty lines, those that begin with #,
    and one line of names above the first numbers do not count.

    Between the lines, ln(J+ + J-) is linear in ln E and in asinh(cos zenith / 0.05), and so is the share of mu+. Below
    the lowest cos zenith the flux is the lowest one's.

    Raises
    ------
    RefusedError
        If the file can't be read or is no such table: the error names the line, and what was expected there.
    """
    numbers, lines = _numbers(path)
    _refuse_impossible(numbers, lines, path)
    energies = _energies(numbers, lines, path)
    cosines, grid = _grid(numbers, lines, len(energies), path)
    order = np.argsort(cosines)
    intensity = _interpolated(energies, cosines[order], grid[order])
    name = Path(path).name
    return Flux(name, f"flux of the table {name}", intensity, float(energies[0]), float(energies[-1]))


def _numbers(path: str | Path) -> tuple[Float, list[int]]:
    """Return the rows, and the number of the line of each."""
    rows: list[list[float]] = []
    lines: list[int] = []
    named = False
    try:
        with Path(path).open(encoding="utf-8-sig") as file:
            for line, text in enumerate(file, 1):
                fields = (text.split(",") if "," in text else text.split()) if not text.startswith("#") else []
                if not text.strip() or not fields:
                    continue
                try:
                    rows.append([float(field) for field in fields])
                except ValueError as error:
                    if not rows and not named:
                        named = True
                        continue
                    raise RefusedError(f"{path}, line {line}: {_shown(text)} is not four numbers") from error
                lines.append(line)
                if len(fields) != 4:
                    raise RefusedError(f"{path}, line {line}: {_shown(text)} is not four numbers: {COLUMNS}")
    except UnicodeDecodeError as error:
        raise RefusedError(f"{path} is no text: expected was a table of {COLUMNS}") from error
    except OSError as error:
        raise RefusedError(f"{path} can't be read: {reason(error)}") from error
    if not rows:
        raise RefusedError(f"{path} has no line of four numbers: {COLUMNS}")
    return np.array(rows), lines


def _shown(text: str) -> str:
    found = text.strip()
    return ascii(found if len(found) <= SHOWN else f"{found[:SHOWN]}...")


def _refuse_impossible(numbers: Float, lines: list[int], path: str | Path) -> None:
    """Refuse a line that no flux can have."""
    energy, cosine, plus, minus = numbers.T
    for bad, what in (
        (~np.isfinite(numbers).all(axis=1), "a number that is not finite"),
        (energy <= 0, "an energy that is not above 0"),
        ((cosine < 0) | (cosine > 1), "a cos zenith outside 0 to 1"),
        ((plus < 0) | (minus < 0), "a negative flux"),
        (plus + minus <= 0, "a flux of 0 for both charges, between which and others no power law goes: leave it out"),
    ):
        if bad.any():
            row = int(np.argmax(bad))
            raise RefusedError(f"{path}, line {lines[row]} has {what}: {', '.join(f'{x:g}' for x in numbers[row])}")


def _energies(numbers: Float, lines: list[int], path: str | Path) -> Float:
    """Return the energies of the first cos zenith."""
    others = numbers[:, 1] != numbers[0, 1]
    first = numbers[: int(np.argmax(others)) if others.any() else len(numbers), 0]
    if len(first) < 2:
        raise RefusedError(
            f"{path}, line {lines[0]}: cos zenith {numbers[0, 1]:g} has one energy: expected were all lines of one "
            "cos zenith, then those of the next"
        )
    falling = np.diff(first) <= 0
    if falling.any():
        row = int(np.argmax(falling)) + 1
        raise RefusedError(
            f"{path}, line {lines[row]}: {first[row]:g} GeV comes after {first[row - 1]:g} GeV: sort the energies "
            "of each cos zenith, rising and each once"
        )
    return first


def _grid(numbers: Float, lines: list[int], energies: int, path: str | Path) -> tuple[Float, Float]:
    """Return each cos zenith once, and the fluxes [cos zenith, energy, charge]."""
    for row, (energy, cosine, *_) in enumerate(numbers):
        block, place = divmod(row, energies)
        if energy != numbers[place, 0] or cosine != numbers[block * energies, 1]:
            raise RefusedError(
                f"{path}, line {lines[row]}: expected was {numbers[place, 0]:g} GeV at cos zenith "
                f"{numbers[block * energies, 1]:g}, found {energy:g} GeV at {cosine:g}: every cos zenith needs the "
                "energies of the first, in the same order"
            )
    if len(numbers) % energies:
        raise RefusedError(
            f"{path}, line {lines[-1]}: the table ends at {numbers[-1, 0]:g} GeV, and every cos zenith needs the "
            "energies of the first"
        )
    cosines = numbers[::energies, 1]
    steps = np.diff(cosines)
    if len(cosines) < 2 or not ((steps > 0).all() or (steps < 0).all()):
        raise RefusedError(
            f"{path}: the values of cos zenith neither rise nor fall: sort them, each once, and give two at least"
        )
    if cosines.max() < 1 - 1e-6:
        raise RefusedError(f"{path} ends at cos zenith {cosines.max():g}: expected was a flux of vertical muons, at 1")
    return cosines, numbers[:, 2:].reshape(len(cosines), energies, 2)


def _interpolated(energies: Float, cosines: Float, grid: Float) -> Intensity:
    """Return the intensity between the lines of a table with rising cos zenith."""
    log_energies, places = np.log(energies), np.arcsinh(cosines / LEVEL)
    total = np.log(grid.sum(axis=-1))
    share = grid[..., 0] / grid.sum(axis=-1)

    def intensity(energy: Float, cos_zenith: Float) -> tuple[Float, Float]:
        row, up = _place(places, np.arcsinh(np.asarray(cos_zenith) / LEVEL))
        column, right = _place(log_energies, np.log(energy))
        corners = (
            (row, column, (1 - up) * (1 - right)),
            (row, column + 1, (1 - up) * right),
            (row + 1, column, up * (1 - right)),
            (row + 1, column + 1, up * right),
        )
        both = np.exp(sum(total[i, j] * weight for i, j, weight in corners))
        plus = both * sum(share[i, j] * weight for i, j, weight in corners)
        return plus, both - plus

    return intensity


def _place(knots: Float, values: Float) -> tuple[NDArray[np.intp], Float]:
    """Return the cell of each value, and where it is there, 0 to 1; what is outside is at the nearest end."""
    cell = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    return cell, np.clip((values - knots[cell]) / (knots[cell + 1] - knots[cell]), 0.0, 1.0)
