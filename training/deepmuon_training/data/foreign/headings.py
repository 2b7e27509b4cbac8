"""What headings say of columns: believed where they are plain, asked about where they are not, and never overruled."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.data.foreign.columns import ANGLES, AZIMUTH, ENERGY, KNOWN, MOMENTUM, UNITS, Columns
from deepmuon_training.data.foreign.table import Table

__all__ = ["columns_of"]

_SPELLINGS = {
    "kinetic_energy ekin e_kin ke": ("E",),
    "total_energy etot e_tot": ("Etot",),
    "energy e": ("E", "Etot"),
    "momentum p ptot p_tot": ("p",),
    "u ux dirx dir_x cosx cos_x cx": ("u",),
    "v uy diry dir_y cosy cos_y cy": ("v",),
    "w uz dirz dir_z cosz cos_z cz": ("w",),
    "theta": ("theta", "zenith"),
    "zenith zenith_angle": ("zenith",),
    "cos_zenith coszenith": ("cos_zenith",),
    "phi azimuth": ("phi", "azimuth"),
    "charge q": ("charge",),
    "pdg_id pdg pdgid pdg_code pdgcode": ("pdg_id",),
    "weight wgt": ("weight",),
}
"""Headings in lower case, without units, and which columns they can be."""

MEANINGS: Mapping[str, Sequence[str]] = {
    **{name: (name,) for name in KNOWN if name != "skip"},
    **{spelling: meaning for spellings, meaning in _SPELLINGS.items() for spelling in spellings.split()},
}

UNIT = re.compile(r"(.+?)[\s_([{/]+([kMGTP]?eV|deg|degrees?|rad|radians?)(?:/c)?[)\]}]*", re.IGNORECASE)
"""A name and its unit: kinetic_energy_MeV, p [GeV/c], theta(deg)."""


def columns_of(table: Table, stated: str | None, unit: str | None, angle: str | None) -> Columns:
    """Return what the columns of a table mean.

    Parameters
    ----------
    table
        The table.
    stated
        Names of its columns, in their order: "E,u,v"; or some of them by their headings: "E=Ekin,u=dirX,v=dirY". The
        headings decide if left out.
    unit, angle
        Units of energies and of angles, where no heading says them.

    Raises
    ------
    RefusedError
        If something is not said, or a heading contradicts what is stated.
    """
    names = _from_headings(table) if stated is None else _stated(table, stated)
    if len(names) != table.width:
        raise RefusedError(f"{table.path} has {table.width} columns, and --columns names {len(names)}")
    for number, (name, heading) in enumerate(zip(names, table.headings, strict=bool(table.headings)), 1):
        meanings = MEANINGS.get(_split(heading)[0], ())
        quantity = name.lstrip("-")
        if meanings and quantity in KNOWN and quantity not in (*meanings, "skip"):
            raise RefusedError(f"{table.path} calls column {number} {heading!r}, and --columns says {name}")
    energy = _unit(table, names, (*ENERGY, *MOMENTUM), unit, "--units", UNITS)
    turned = _unit(table, names, ("theta", "zenith", *AZIMUTH), angle, "--angles", ANGLES)
    return Columns(names, energy or "GeV", turned or "rad")


def _from_headings(table: Table) -> list[str]:
    if not table.headings:
        begins = f" (it begins with {table.first_line})" if table.first_line else ""
        raise RefusedError(f"{table.path} has no heading that names its {table.width} columns{begins}: give --columns")
    names = []
    for heading in table.headings:
        meanings = MEANINGS.get(_split(heading)[0], ("skip",))
        if len(meanings) > 1:
            either = " or ".join(meanings)
            raise RefusedError(f"{table.path}: the column {heading!r} can be {either}: say which by --columns")
        names.append(meanings[0])
    if all(name == "skip" for name in names):
        raise RefusedError(f"{table.path}: the headings {', '.join(table.headings)} are none known: give --columns")
    return names


def _stated(table: Table, stated: str) -> list[str]:
    parts = [part.strip() for part in stated.split(",")]
    if "=" not in stated:
        return parts
    names = ["skip"] * table.width
    for part in parts:
        name, _, heading = (word.strip() for word in part.partition("="))
        if heading not in table.headings:
            raise RefusedError(
                f"{table.path} has no column {heading!r} for {name}, but {', '.join(table.headings) or 'no headings'}"
            )
        names[table.headings.index(heading)] = name
    return names


def _unit(
    table: Table, names: Sequence[str], quantities: Iterable[str], stated: str | None, option: str, known: Iterable[str]
) -> str | None:
    """Return the unit of some quantities, or None if no column is one of them."""
    using = [i for i, name in enumerate(names) if name.lstrip("-") in quantities]
    if not using:
        if stated is not None and option == "--angles":
            raise RefusedError(f"{option} {stated} goes with angles, and no column is one")
        return None
    found = {_split(table.headings[i])[1]: table.headings[i] for i in using if table.headings}
    found.pop(None, None)
    written = {unit.lower(): unit for unit in known}
    units = {written[str(unit)]: heading for unit, heading in found.items() if unit in written}
    if len(units) > 1:
        raise RefusedError(f"{table.path} has columns in different units: {', '.join(units.values())}")
    for unit, heading in units.items():
        if stated not in (None, unit):
            raise RefusedError(f"{table.path} calls a column {heading!r}, and {option} says {stated}: leave it out")
        return unit
    if stated is None:
        raise RefusedError(f"{table.path} does not say the unit of {names[using[0]]}: give {option}")
    return stated


def _split(heading: str) -> tuple[str, str | None]:
    """Return a heading in lower case without its unit, and the unit."""
    match = UNIT.fullmatch(heading.strip())
    name, unit = (match[1], match[2].lower()) if match else (heading.strip(), None)
    if unit is not None and not unit.endswith("ev"):
        unit = unit[:3]
    return re.sub(r"[\s-]+", "_", name).lower(), unit
