"""Whether a file of muons, of any format, is good."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.formats.registry import HDF5, format_of, opened_muons
from deepmuon_runtime.formats.source import Columns, Source
from deepmuon_runtime.muon_file import check as hdf5
from deepmuon_runtime.muon_file.check import Report, examine_muons

__all__ = ["check_file"]


def check_file(path: str | Path, progress: Callable[[int], object] = lambda _: None) -> Report:
    """Check a file of muons against its format, and each of its muons.

    The muons are read in pieces: the memory needed does not grow with their number. HDF5 can end the process, or
    never return, on a damaged file; the command `deepmuon-check` survives that.

    Parameters
    ----------
    path
        A muon file of any version, or an MCPL, ROOT or CSV file that was written here.
    progress
        Called again and again with the number of muons read since the last call.

    Raises
    ------
    RefusedError
        If the file can't be opened, or is no file of muons; of other formats than HDF5 also if what it says of them is
        damaged.
    """
    form = format_of(path)
    if form is HDF5:
        return hdf5.check_file(path, progress)
    with opened_muons(path) as source:
        report = Report()
        report.describe(source.attributes)
        examine_muons(_pieces(source, report), report, progress, rounding=form.rounding)
        return report


def _pieces(source: Source, report: Report) -> Iterator[Columns]:
    """Yield the muons; what keeps one from reading on is a defect."""
    try:
        yield from source.pieces()
    except RefusedError as error:
        report.defects.append(str(error))
