"""The shards of a run joined to the single run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.latents.shard import WHOLE_RUN
from deepmuon_runtime.muon_file.attributes import LIVE_TIMES
from deepmuon_runtime.muon_file.format import COLUMNS, bytes_per_muon
from deepmuon_runtime.muon_file.output import check_muon_output
from deepmuon_runtime.muon_file.reader import opened, verify_muons
from deepmuon_runtime.muon_file.writer import MuonWriter
from deepmuon_runtime.room import check_disk

__all__ = ["merge_shards"]

PIECE = 1 << 17  # muons copied at once

NEEDED = ("seed", "first", "total", "model_sha256")
OF_ONE_SHARD = ("count", "first", "shard", *LIVE_TIMES, "created", "created_by", "command_line")


class _Part(NamedTuple):
    """A file and what it says of its muons; sorts by their numbers."""

    first: int
    end: int
    path: Path
    attributes: dict[str, Any]
    columns: tuple[str, ...]


def merge_shards(
    paths: Sequence[str | Path],
    output: str | Path,
    *,
    overwrite: bool = False,
    virtual: bool = False,
    progress: Callable[[int], object] = lambda _: None,
) -> int:
    """Join the shards of a run, in the order of their muons, to one file, which is that of the single run.

    Its attributes are too, but for `created`, and for `created_by` and `command_line`, which are those of the first
    shard: its muons are decided by the model, the seed, their number and the device, on which the shards must agree.

    Parameters
    ----------
    paths
        Files of shards, in any order. They may cut the run into parts of different sizes.
    output, overwrite
        As for `MuonWriter`.
    virtual
        Whether the shards keep the muons, and the file only refers to them, by paths relative to its folder. They are
        read all the same, once: damaged ones are refused.
    progress
        Called again and again with the number of muons read since the last call.

    Returns
    -------
    The number of muons.

    Raises
    ------
    RefusedError
        If a file is no shard or damaged, they are not of one run, muons are missing or in two of them, or `output`
        can't be written or is one of them.
    FailedError
        If writing fails, or another process writes `output` meanwhile.
    """
    parts = []
    for path in paths:
        progress(0)
        parts.append(_part(Path(path)))
    if not parts:
        raise RefusedError("there are no shards to be merged")
    parts.sort(key=lambda part: (part.first, part.end))
    for part in parts[1:]:
        _check_same_run(parts[0], part)
    check_muon_output(output, overwrite, [part.path for part in parts])  # a virtual file would look for muons in itself
    total = parts[0].attributes["total"]
    _check_complete(parts, total)
    described = {name: value for name, value in parts[0].attributes.items() if name not in LIVE_TIMES}
    described |= {"shard": str(WHOLE_RUN), "first": 0, "seed": np.uint64(described["seed"])}
    columns = parts[0].columns
    folder = check_muon_output(output, overwrite).parent
    if not virtual:
        check_disk(folder, total * bytes_per_muon(columns), f"{total:,} muons")
    with MuonWriter(output, described, overwrite, optional=set(columns) - set(COLUMNS)) as writer:
        if virtual:
            writer.refer([part.path for part in parts], progress)
            for part in parts:
                verify_muons(part.path, progress)
        else:
            for part in parts:
                _copy(part, writer, progress)
    return int(total)


def _copy(part: _Part, writer: MuonWriter, progress: Callable[[int], object]) -> None:
    """Copy the muons of a shard, unless they are not those that were written to it."""
    with opened(part.path) as file:
        for columns in file.pieces(PIECE, part.columns):
            writer.append_columns(columns)
            progress(len(columns["pdg_id"]))


def _part(path: Path) -> _Part:
    with opened(path) as file:
        attributes, columns = file.attributes, tuple(file.columns)
    missing = [name for name in NEEDED if name not in attributes]
    if missing:
        raise RefusedError(f"{path} is no shard of a run: it lacks the attribute {missing[0]}")
    return _Part(attributes["first"], attributes["first"] + attributes["count"], path, attributes, columns)


def _check_same_run(part: _Part, other: _Part) -> None:
    if part.columns != other.columns:
        raise RefusedError(
            f"{part.path} and {other.path} are of different runs: their columns are {', '.join(part.columns)} and "
            f"{', '.join(other.columns)}"
        )
    names = (part.attributes.keys() | other.attributes.keys()) - set(OF_ONE_SHARD)
    for name in sorted(names):
        one, two = part.attributes.get(name), other.attributes.get(name)
        if one != two:
            raise RefusedError(
                f"{part.path} and {other.path} are of different runs: their {name} is {one!r} and {two!r}"
            )


def _check_complete(parts: Sequence[_Part], total: int) -> None:
    end = 0
    for part in parts:
        if part.first > end:
            raise RefusedError(f"muons {end} to {part.first - 1} of {total} are missing: no shard before {part.path}")
        if part.first < end:
            raise RefusedError(f"muons {part.first} to {min(end, part.end) - 1} are in {part.path} and in another one")
        end = part.end
    if end != total:
        raise RefusedError(f"muons {end} to {total - 1} of {total} are missing: no shard after {parts[-1].path}")
