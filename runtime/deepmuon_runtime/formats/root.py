"""ROOT: a TTree `muons`, a branch a column, and the text `deepmuon`, which says in JSON what the file says of them.

Needs uproot: ``pip install 'deepmuon-runtime[root]'``. The names and units of the branches are those of a muon file;
`pdg_id` is a 32-bit number, since ROOT takes those of 8 bits for letters.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.formats.notes import COLUMN_NAMES, said, understood
from deepmuon_runtime.formats.source import PIECE, Columns, Source
from deepmuon_runtime.formats.writing import Writer
from deepmuon_runtime.muon_file.checksum import crc32, unlike
from deepmuon_runtime.muon_file.format import CHECKSUM, bytes_per_muon, column_types

__all__ = ["MAGIC", "NEEDED", "RootWriter", "bytes_in_tree", "opened_root"]

MAGIC = b"root"
"""How a file begins."""

NEEDED = ("uproot", "root")
"""The package that writes and reads, and the extra that brings it."""

TREE, TEXT = "muons", "deepmuon"
BASKET = 1 << 20  # muons of a basket: uproot lists all baskets again with each new one


def bytes_in_tree(names: Collection[str]) -> int:
    """Return the bytes that a muon with such columns takes."""
    return bytes_per_muon(names) + 3  # of pdg_id


class RootWriter(Writer):
    """Writes a TTree; see `deepmuon_runtime.formats.writing.Writer`."""

    def _begin(self) -> None:
        import uproot

        said(self._description.of(0))  # what can't be said is refused now, and not at the end
        self._root = uproot.recreate(_Kept(self._file), compression=None)  # random numbers hardly shrink
        self._tree = self._root.mktree(TREE, {name: _in_tree(dtype) for name, dtype in self._types.items()})
        self._checksums = dict.fromkeys(self._types, 0)
        self._waiting: list[Columns] = []
        self._waiting_count = 0
        self._flushed = 0

    def _append(self, columns: Columns) -> None:
        for name, values in columns.items():
            self._checksums[name] = crc32(values.data, self._checksums[name])
        # Copies: whoever gave the columns may fill their memory again.
        self._waiting.append({name: columns[name].astype(_in_tree(dtype)) for name, dtype in self._types.items()})
        self._waiting_count += len(columns["pdg_id"])
        if self._waiting_count >= BASKET:
            self._extend()

    def _finish(self) -> None:
        self._extend()
        attributes = self._description.of(self.count)
        stated = said(attributes, **{COLUMN_NAMES: list(self._types), CHECKSUM: self._checksums})
        self._root[TEXT] = json.dumps(stated)
        self._root.close()

    def _extend(self) -> None:
        """Write a basket of each branch."""
        if not self._waiting_count:
            return
        waiting, self._waiting = self._waiting, []
        self._waiting_count = 0
        self._tree.extend({name: np.concatenate([columns[name] for columns in waiting]) for name in self._types})
        self._flush.wrote(os.fstat(self._file.fileno()).st_size - self._flushed)
        self._flushed = os.fstat(self._file.fileno()).st_size


class _Kept:
    """A file that uproot does not close, so that it can still be brought to the disk."""

    def __init__(self, file: Any) -> None:
        self._file = file

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def close(self) -> None:
        self._file.flush()


def _in_tree(dtype: np.dtype[Any]) -> np.dtype[Any]:
    return np.dtype(np.int32) if dtype.itemsize == 1 else dtype.newbyteorder("=")


@contextmanager
def opened_root(path: str | Path) -> Iterator[Source]:
    """Open a ROOT file that DeepMuon wrote.

    Raises
    ------
    RefusedError
        Here or while it is read, if it can't be read, is damaged, or somebody else's.
    """
    import uproot

    with ExitStack() as stack:
        with _errors(path):  # not around what is made of the muons, whose errors are none of this file
            source = _source(stack.enter_context(uproot.open(path)), path)
        yield source


def _source(file: Any, path: str | Path) -> Source:
    names = file.keys(cycle=False)
    if TREE not in names or TEXT not in names:
        raise RefusedError(
            f"{path} was not written by DeepMuon: it lacks the tree {TREE} or the text {TEXT} (deepmuon-train "
            "convert reads others)"
        )
    stated = json.loads(str(file[TEXT]))
    if not isinstance(stated, dict):
        raise RefusedError(f"{path} is damaged: its text {TEXT} is none of ours")
    attributes, more = understood(stated, path)
    types, tree = column_types(more.get(COLUMN_NAMES), path), file[TREE]
    if tree.num_entries != attributes["count"]:
        raise RefusedError(f"{path} has {tree.num_entries} muons, and says that it has {attributes['count']}")
    if tree.typenames() != {name: _TYPES[_in_tree(dtype).str[1:]] for name, dtype in types.items()}:
        raise RefusedError(f"{path} is damaged: its branches are {tree.typenames()}")
    return Source(attributes, tuple(types), lambda: _pieces(path, tree, types, more.get(CHECKSUM)))


_TYPES = {"f4": "float", "f8": "double", "i4": "int32_t"}


def _pieces(path: str | Path, tree: Any, types: Mapping[str, np.dtype[Any]], expected: Any) -> Iterator[Columns]:
    found = dict.fromkeys(types, 0)
    with _errors(path):
        for first in range(0, tree.num_entries, PIECE):
            piece = tree.arrays(list(types), entry_start=first, entry_stop=first + PIECE, library="np")
            columns: dict[str, NDArray[Any]] = {}
            for name, dtype in types.items():
                columns[name] = np.ascontiguousarray(piece[name], dtype)
                found[name] = crc32(columns[name].data, found[name])
            yield columns
    for name, checksum in found.items():
        if not isinstance(expected, dict) or checksum != expected.get(name):
            right = expected.get(name, 0) if isinstance(expected, dict) else 0
            raise RefusedError(f"{path} is damaged: the column {name} {unlike(checksum, right)}")


@contextmanager
def _errors(path: str | Path) -> Iterator[None]:
    """Turn whatever a damaged file makes uproot raise into one line."""
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise RefusedError(f"{path} can't be read: it is a folder, a pipe or a device")
        yield
    except (RefusedError, MemoryError):
        raise
    except Exception as error:
        raise RefusedError(f"{path} can't be read as a ROOT file: {reason(error)}") from error
