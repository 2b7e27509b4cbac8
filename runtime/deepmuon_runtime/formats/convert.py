"""From one format to another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.formats.csv import UNITS, CsvWriter
from deepmuon_runtime.formats.registry import opened_muons, output_format
from deepmuon_runtime.muon_file.attributes import LIVE_TIMES
from deepmuon_runtime.muon_file.format import COLUMNS
from deepmuon_runtime.room import check_disk

__all__ = ["convert_file"]

MADE_AGAIN = ("count", "created", *LIVE_TIMES)  # by who writes


def convert_file(
    path: str | Path,
    output: str | Path,
    *,
    format: str | None = None,
    unit: str | None = None,
    header: bool = True,
    overwrite: bool = False,
    progress: Callable[[int], object] = lambda _: None,
) -> None:
    """Write the muons of a file to a file of another format, with all that is known of them.

    Parameters
    ----------
    path
        A file of any format of `registry.FORMATS` that was written here.
    output
        The file to be written.
    format
        Its format; what the end of its name says if left out.
    unit
        Of the energy, where that is text: one of `csv.UNITS`; GeV if left out.
    header
        Whether text has comments, and a line with the names of the columns.
    overwrite
        Whether an existing file is replaced.
    progress
        Called again and again with the number of muons written since the last call.

    Raises
    ------
    RefusedError
        If `path` can't be read, is damaged or somebody else's, `output` can't be written or is that file, or there is
        no such format or unit.
    FailedError
        If writing fails, or another process writes `output` meanwhile.
    """
    form = output_format(output, format)
    folder = form.check_output(output, overwrite, [path]).parent
    with opened_muons(path) as source:
        count = source.attributes["count"]
        check_disk(folder, count * form.bytes_per_muon(source.names), f"{count:,} muons")
        attributes = {name: value for name, value in source.attributes.items() if name not in MADE_AGAIN}
        writer = form.writer(output, attributes, overwrite, optional=set(source.names) - COLUMNS.keys())
        if isinstance(writer, CsvWriter):
            writer.shown_as(_checked(unit or "GeV"), header)
        elif unit is not None or not header:
            raise RefusedError(f"--units and --no-header are for text, and {output} is of the format {form.name}")
        with writer:
            for columns in source.pieces():
                writer.append_columns(columns)
                progress(len(columns["pdg_id"]))


def _checked(unit: str) -> str:
    if unit not in UNITS:
        raise RefusedError(f"there is no unit {unit!r}: energies are in {' or '.join(UNITS)}")
    return unit
