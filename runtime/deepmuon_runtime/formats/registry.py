"""All formats: which one a name means, and which one a file has."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.files.output import check_output
from deepmuon_runtime.formats import csv, mcpl, root
from deepmuon_runtime.formats.packing import opened_bytes
from deepmuon_runtime.formats.source import PIECE, Source
from deepmuon_runtime.formats.writing import Writer
from deepmuon_runtime.muon_file.format import bytes_per_muon
from deepmuon_runtime.muon_file.output import check_muon_output, refuse_stdout
from deepmuon_runtime.muon_file.reader import opened
from deepmuon_runtime.muon_file.writer import MuonWriter

__all__ = ["FORMATS", "Format", "format_of", "opened_muons", "output_format"]

Opened = Callable[[str | Path], AbstractContextManager[Source]]


@dataclass(frozen=True)
class Format:
    """A format that muons are written in, and read from if they are ours.

    Parameters
    ----------
    name
        What `--format` calls it, and how its files end without the point.
    writer
        Writes a file; called as `MuonWriter`.
    opened
        Opens one.
    bytes_per_muon
        Least size of a muon with the columns named, in bytes.
    endings
        Other ends of names of its files.
    needed
        A package that it needs, and the extra that brings it.
    rounding
        How far an energy may be from the muon file's, relative.
    """

    name: str
    writer: Callable[..., Writer | MuonWriter]
    opened: Opened
    bytes_per_muon: Callable[[Collection[str]], int]
    endings: tuple[str, ...] = ()
    needed: tuple[str, str] | None = None
    rounding: float = 0.0

    @property
    def suffixes(self) -> tuple[str, ...]:
        """How names of its files end."""
        return tuple(f".{ending}" for ending in (self.name, *self.endings))

    def check_needed(self) -> None:
        """Refuse it where a package is missing that it needs."""
        if self.needed is not None and find_spec(self.needed[0]) is None:
            package, extra = self.needed
            raise RefusedError(
                f"for {self.name.upper()} the package {package} is needed: pip install 'deepmuon-runtime[{extra}]'"
            )

    def check_output(self, path: str | Path, overwrite: bool = False, inputs: Iterable[str | Path] = ()) -> Path:
        """Tell whether muons can be written at `path`; see `deepmuon_runtime.files.output.check_output`."""
        self.check_needed()
        refuse_stdout(path)
        return (check_muon_output if self is HDF5 else check_output)(path, overwrite, inputs)


@contextmanager
def _opened_hdf5(path: str | Path) -> Iterator[Source]:
    with opened(path) as file:
        names = tuple(file.columns)
        yield Source(file.attributes, names, lambda: file.pieces(PIECE, names))


def _packed(least: Callable[[Collection[str]], int]) -> Callable[[Collection[str]], int]:
    return lambda names: least(names) // 3  # they hardly shrink by more than half


HDF5 = Format("h5", MuonWriter, _opened_hdf5, bytes_per_muon, ("hdf5",))
MCPL = Format("mcpl", mcpl.McplWriter, mcpl.opened_mcpl, mcpl.bytes_per_muon, rounding=mcpl.ROUNDING)
CSV = Format("csv", csv.CsvWriter, csv.opened_csv, csv.bytes_per_muon)
ROOT = Format("root", root.RootWriter, root.opened_root, root.bytes_in_tree, needed=root.NEEDED)

FORMATS = {
    form.name: form
    for form in (
        HDF5,
        MCPL,
        Format(
            "mcpl.gz", mcpl.PackedMcplWriter, mcpl.opened_mcpl, _packed(mcpl.bytes_per_muon), rounding=mcpl.ROUNDING
        ),
        ROOT,
        CSV,
        Format("csv.gz", csv.PackedCsvWriter, csv.opened_csv, _packed(csv.bytes_per_muon)),
    )
}
"""By the name that `--format` takes."""


def output_format(path: str | Path, name: str | None = None) -> Format:
    """Return the format that a file to be written shall have.

    Parameters
    ----------
    path
        The file, whose end decides; HDF5 where that is none of a format.
    name
        A name of `FORMATS`, where the format was asked for.

    Raises
    ------
    RefusedError
        If there is no such format, or the name of the file is that of another one.
    """
    lower = Path(path).name.lower()
    # The longest end first: .csv.gz is not .csv.
    by_end = sorted(((suffix, form) for form in FORMATS.values() for suffix in form.suffixes), key=lambda x: -len(x[0]))
    meant = next((form for suffix, form in by_end if lower.endswith(suffix)), None)
    if name is None:
        return meant or HDF5
    if name not in FORMATS:
        raise RefusedError(f"there is no format {name!r}: they are {', '.join(FORMATS)}")
    if meant is not None and meant.name != name:
        raise RefusedError(f"{path} is the name of a file of the format {meant.name}, and --format asks for {name}")
    return FORMATS[name]


def format_of(path: str | Path) -> Format:
    """Return the format of a file of muons, by its first bytes; HDF5, whose reader says what is wrong, if by none."""
    try:
        with opened_bytes(path) as file:
            beginning = file.read(64)
    except RefusedError:
        return HDF5
    if beginning.startswith(b"MCPL"):
        return MCPL
    if beginning.startswith(root.MAGIC):
        return ROOT
    return CSV if csv.is_csv(beginning) else HDF5


@contextmanager
def opened_muons(path: str | Path) -> Iterator[Source]:
    """Open a file of muons of any format that was written here.

    Raises
    ------
    RefusedError
        Here or while it is read, if it can't be read, is damaged or somebody else's, or a package is missing.
    """
    form = format_of(path)
    form.check_needed()
    with form.opened(path) as source:
        yield source
