"""Trees of ROOT, as TTree or RNTuple: each branch with one number an entry is a column."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_training.data.foreign.table import Float, Place, Table, numbered

__all__ = ["file_of", "open_root"]

PIECE = 1 << 18  # entries read at once

TREES = ("TTree", "TNtuple", "TNtupleD", "ROOT::RNTuple")

NUMBER = re.compile(r"(std::)?(float|double|u?int\d+_t|(unsigned )?(int|long|short|char)|Long64_t)")
"""Types of a branch that is a column: no text, no array, no vector."""


def open_root(path: str | Path) -> Table:
    """Open a tree.

    Parameters
    ----------
    path
        The file, and the tree where it has several: muons.root or muons.root:tree.

    Raises
    ------
    RefusedError
        Here or while its rows are read: if the package `uproot` is missing, the file can't be read, has no such tree,
        or the tree no entry or no column.
    """
    try:
        import uproot
    except ImportError as error:
        raise RefusedError("to read ROOT uproot is needed: pip install 'deepmuon-training[root]'") from error

    name = _split(path)[1]
    try:
        content = uproot.open(file_of(path))
        trees = [key for key, kind in content.classnames(cycle=False).items() if kind in TREES]
        chosen = _chosen(path, name, trees)
        tree = content[chosen]
        types, entries = tree.typenames(), int(tree.num_entries)
    except RefusedError:
        raise
    except Exception as error:  # whatever a damaged file makes it raise
        raise RefusedError(f"{path} can't be read as a ROOT file: {reason(error)}") from error
    columns = [branch for branch, kind in types.items() if NUMBER.fullmatch(kind)]
    if not columns or not entries:
        raise RefusedError(f"{path}: {chosen} has {entries} entries, and {len(columns)} branches of one number each")

    def rows(wanted: Sequence[int]) -> Iterator[tuple[Place, Float]]:
        yield from _rows(path, tree, [columns[i] for i in wanted])

    return Table(path, len(columns), rows, tuple(columns))


def file_of(path: str | Path) -> Path:
    """Return the file without the name of its tree."""
    return Path(_split(path)[0])


def _split(path: str | Path) -> tuple[str, str]:
    file, mark, name = str(path).rpartition(".root:")
    return (f"{file}.root", name) if mark else (str(path), "")


def _chosen(path: str | Path, name: str, trees: list[str]) -> str:
    if name and name not in trees:
        raise RefusedError(f"{path}: there is no tree {name}, but {', '.join(trees) or 'none at all'}")
    if not name and len(trees) != 1:
        several = f"the trees {', '.join(trees)}: name one, as in {path}:{trees[0]}" if trees else "no tree"
        raise RefusedError(f"{path} has {several}")
    return name or trees[0]


def _rows(path: str | Path, tree: Any, names: list[str]) -> Iterator[tuple[Place, Float]]:
    first = 0
    try:
        for piece in tree.iterate(names, step_size=PIECE, library="np"):
            numbers = np.stack([np.asarray(piece[name], np.float64) for name in names], axis=1)
            yield numbered(path, "entry", first), numbers
            first += len(numbers)
    except RefusedError:
        raise
    except Exception as error:
        raise RefusedError(f"{path} can't be read after entry {first}: {reason(error)}") from error
