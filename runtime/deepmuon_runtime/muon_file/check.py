"""Whether a muon file keeps its format, and whether what it holds are muons."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from deepmuon_runtime.errors import reason
from deepmuon_runtime.memory_limit import is_limited
from deepmuon_runtime.model.metadata import Model
from deepmuon_runtime.model.released import list_models, read_released
from deepmuon_runtime.muon_file.attributes import attribute_defects, checksum_defects, is_generated, sound_attributes
from deepmuon_runtime.muon_file.checksum import crc32, unlike
from deepmuon_runtime.muon_file.columns import (
    columns_of,
    missing_columns,
    statement_defects,
    storage_defects,
    type_defects,
)
from deepmuon_runtime.muon_file.damage import READ_ERRORS, member
from deepmuon_runtime.muon_file.format import CHECKSUM, COLUMNS, check_format, stated
from deepmuon_runtime.muon_file.place_and_time import PlacesAndTimes, cuts_of, target_of_file
from deepmuon_runtime.muon_file.reader import opened_file
from deepmuon_runtime.muon_file.virtual import VirtualColumn, opened_source
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_runtime.physical import POSITIVE_ENERGIES, describe, explain, find_unphysical

__all__ = ["Report", "check_file", "examine_muons"]

PIECE = 1 << 17  # muons read at once


@dataclass
class Report:
    """What a check found.

    Attributes
    ----------
    defects : list of str
        What is wrong, a line each; none if the file is good.
    attributes : dict
        The attributes of the format whose values are what they can be.
    model : Model or None
        The released model that made the muons, if it was one.
    examined : int
        Muons that were read and counted below.
    mu_plus, mu_minus : int
        How many of each.
    mean_energy : float
        Mean kinetic energy in GeV; NaN if there is none.
    mean_cos_zenith : float
        Mean cosine of the zenith angle; NaN if there is none.
    """

    defects: list[str] = field(default_factory=list)
    attributes: dict[str, Any] = field(default_factory=dict)
    model: Model | None = None
    examined: int = 0
    mu_plus: int = 0
    mu_minus: int = 0
    energy_sum: float = 0.0
    cos_zenith_sum: float = 0.0

    @property
    def mean_energy(self) -> float:  # noqa: D102 - above
        return self.energy_sum / self.examined if self.examined else float("nan")

    @property
    def mean_cos_zenith(self) -> float:  # noqa: D102 - above
        return self.cos_zenith_sum / self.examined if self.examined else float("nan")

    def describe(self, attributes: Mapping[str, Any]) -> None:
        """Note what the file says of its muons, and what is wrong with that."""
        self.attributes = sound_attributes(attributes)
        if is_generated(attributes):
            self.model = _released_model(self.attributes)
        self.defects += attribute_defects(attributes, self.model)

    def add(self, muons: Muons) -> None:
        """Count muons."""
        self.examined += len(muons)
        self.mu_plus += int(np.count_nonzero(muons.pdg_id == MU_PLUS))
        self.mu_minus += int(np.count_nonzero(muons.pdg_id == MU_MINUS))
        with np.errstate(all="ignore"):  # the file may hold anything
            self.energy_sum += float(muons.kinetic_energy.sum(dtype=float))
            self.cos_zenith_sum += float(muons.cos_zenith.sum(dtype=float))


def check_file(path: str | Path, progress: Callable[[int], object] = lambda _: None) -> Report:
    """Check a muon file against its format, and each of its muons.

    The muons are read in pieces: the memory needed does not grow with their number. HDF5 can end the process, or
    never return, on a damaged file; the command `deepmuon-check` survives that.

    Parameters
    ----------
    path
        A muon file, of any format version.
    progress
        Called again and again with the number of muons read since the last call.

    Raises
    ------
    RefusedError
        If the file can't be opened, or is no muon file of this version.
    """
    with opened_file(path) as file:
        return _report(file, check_format(file, path), progress)


def _report(file: h5py.File, version: int, progress: Callable[[int], object]) -> Report:
    report = Report()
    group = member(file, "muons")
    if not isinstance(group, h5py.Group):
        report.defects.append("there is no group /muons")
        return report
    attributes = _read_attributes(group, "/muons", report.defects)
    if attributes:
        report.defects += checksum_defects(attributes, version)
    report.describe(attributes)
    there = columns_of(group, version)
    missing = list(missing_columns(group, there, version))
    report.defects += (f"the column {name} is missing" for name in missing)
    columns = _sound_columns(there, report.attributes.get("count"), report.defects, progress)
    if not missing and columns.keys() == there.keys() and len({len(column) for column in columns.values()}) == 1:
        examine_muons(_pieces(columns, report), report, progress)
    else:
        report.defects.append("the muons were not examined, because the columns are not sound")
    return report


def _read_attributes(node: h5py.HLObject, name: str, defects: list[str]) -> dict[str, Any]:
    try:
        return stated(node)
    except READ_ERRORS as error:
        defects.append(f"the attributes of {name} can't be read: {_reason(error)}")
        return {}


def _reason(error: Exception) -> str:
    """Return why something can't be read.

    Raises
    ------
    MemoryError
        If it is for want of memory, and that is limited: no defect of the file.
    """
    why = reason(error)
    if is_limited() and (isinstance(error, MemoryError) or "alloc" in why):
        raise MemoryError(why) from error
    return why


def _released_model(sound: dict[str, Any]) -> Model | None:
    """Return the released model that made the muons; a family at their depth, where it has that."""
    shipped = next((model for model in list_models() if model.sha256 == sound.get("model_sha256")), None)
    depth = sound.get("depth_m", math.nan)
    if shipped is None or not shipped.is_family or not shipped.has_depth(depth):
        return shipped
    from deepmuon_runtime.model.opening import checked_model, load_model  # ONNX Runtime, which gives the rate

    contents, model = checked_model(read_released(shipped), shipped.name, depth, sound.get("surface"))
    return load_model(contents, model, "cpu")[1]


def _sound_columns(
    there: dict[str, h5py.Dataset], count: int | None, defects: list[str], progress: Callable[[int], object]
) -> dict[str, _Column]:
    """Return the columns that can be read as the format's, and note the defects of all."""
    sound = {}
    for name, column in there.items():
        try:
            found = list(_column_defects(column, name, progress))
            if not found:
                stored = VirtualColumn(column, name, progress) if column.is_virtual else column
        except READ_ERRORS as error:
            found = [f"can't be read: {_reason(error)}"]
        attributes = _read_attributes(column, name, defects)
        if not found:
            sound[name] = _Column(stored, attributes.get(CHECKSUM))
        found += statement_defects(column, attributes, name, None if found else count)
        defects += (f"the column {name} {defect}" for defect in found)
    return sound


def _column_defects(column: h5py.Dataset, name: str, progress: Callable[[int], object]) -> Iterator[str]:
    """Yield what keeps a column from being read."""
    wrong_type = list(type_defects(column, name))
    if wrong_type or not column.is_virtual:
        yield from wrong_type or storage_defects(column)
    else:
        yield from _source_defects(VirtualColumn(column, name), progress)


def _source_defects(column: VirtualColumn, progress: Callable[[int], object]) -> Iterator[str]:
    """Yield the first of the sources that can't be read, and how many others can't."""
    defects = []
    for source in column.sources:
        progress(0)
        try:
            with opened_source(source):
                pass
        except OSError as error:
            defects.append(reason(error))
    if defects:
        yield f"can't be read: {defects[0]}" + (f", and {len(defects) - 1} others" if len(defects) > 1 else "")


@dataclass
class _Column:
    """A column that can be read, and its CRC-32 by its attribute and by what was read of it so far."""

    stored: h5py.Dataset | VirtualColumn
    expected: int | None
    found: int = 0

    def read(self, span: slice) -> Any:
        """Return the next muons' values."""
        values = self.stored[span]
        self.found = crc32(values.data, self.found)
        return values

    def __len__(self) -> int:
        return len(self.stored)


def _pieces(columns: dict[str, _Column], report: Report) -> Iterator[dict[str, Any]]:
    """Yield the columns of all muons piece by piece, and note what can't be read, or is not what was written."""
    total = len(columns["pdg_id"])
    for first in range(0, total, PIECE):
        span = slice(first, min(first + PIECE, total))
        try:
            values = {name: column.read(span) for name, column in columns.items()}
        except READ_ERRORS as error:
            report.defects.append(f"the muons from {first} on can't be read: {_reason(error)}")
            return
        yield values
    report.defects += _checksum_defects(columns)


def examine_muons(
    pieces: Iterable[Mapping[str, Any]], report: Report, progress: Callable[[int], object], *, rounding: float = 0.0
) -> None:
    """Look at all muons and note, for each fault, the first that has it and how many have.

    Parameters
    ----------
    pieces
        The columns of the muons, optional ones included, piece by piece.
    report
        Which takes note; its `model` and `attributes` say what the muons can be.
    progress
        Called with the number of muons of each piece.
    rounding
        How far a file of this format may keep an energy from what it was, relative.
    """
    model = report.model
    energies = POSITIVE_ENERGIES if model is None else (model.energy_min_gev, model.energy_max_gev)
    if model is not None and rounding:
        energies = energies[0] * (1 - rounding), energies[1] * (1 + rounding)
    faults: dict[str, _Faulty] = {}
    cuts = cuts_of(report.attributes)
    places_and_times = PlacesAndTimes(report.attributes.get("live_time_s"), target_of_file(report.attributes))
    first = 0
    for values in pieces:
        muons = Muons(**{name: values[name] for name in COLUMNS})
        report.add(muons)
        unphysical = ((explain(fault, *energies), bad) for fault, bad in find_unphysical(muons, *energies).items())
        outside = [("is outside the cuts", ~cuts.keeps(muons, rounding))] if cuts else []
        for fault, bad in chain(unphysical, outside, places_and_times.faults(values)):
            if bad.any():
                index = int(np.argmax(bad))
                known = faults.setdefault(fault, _Faulty(first + index, describe(muons, index)))
                known.count += int(np.count_nonzero(bad))
        progress(len(muons))
        first += len(muons)
    report.defects += (f"muon {known.first} {fault} ({known.muon}){known.others}" for fault, known in faults.items())


def _checksum_defects(columns: dict[str, _Column]) -> Iterator[str]:
    """Yield which columns, read to their end, are not what was written."""
    for name, column in columns.items():
        if isinstance(column.expected, int) and column.found != column.expected:
            where = " (or one of its sources)" if isinstance(column.stored, VirtualColumn) else ""
            yield f"the column {name}{where} {unlike(column.found, column.expected)}"


@dataclass
class _Faulty:
    """What is wrong with some muons."""

    first: int
    muon: str
    count: int = 0

    @property
    def others(self) -> str:
        return f"; so {self.count} muons" if self.count > 1 else ""
