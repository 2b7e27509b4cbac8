"""The shards of a run joined to the single run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.files.output import check_output
from deepmuon_runtime.latents.shard import WHOLE_RUN
from deepmuon_runtime.muon_file.checksum import unlike
from deepmuon_runtime.muon_file.format import COLUMNS
from deepmuon_runtime.muon_file.reader import read_attributes, read_checksums, read_pieces
from deepmuon_runtime.muon_file.writer import MuonWriter

__all__ = ["merge_shards"]

PIECE = 1 << 17  # muons copied at once

NEEDED = ("seed", "first", "total", "model_sha256")
OF_ONE_SHARD = ("count", "first", "shard", "live_time_s_m2", "created", "created_by", "command_line")


class _Part(NamedTuple):
    """A file and what it says of its muons; sorts by their numbers."""

    first: int
    end: int
    path: Path
    attributes: dict[str, Any]


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
        Whether the shards keep the muons, and the file only refers to them, by paths relative to its folder.
    progress
        Called again and again with the number of muons copied since the last call.

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
    check_output(output, overwrite, [part.path for part in parts])  # a virtual file would look for muons in itself
    total = parts[0].attributes["total"]
    _check_complete(parts, total)
    described = {name: value for name, value in parts[0].attributes.items() if name != "live_time_s_m2"}
    described |= {"shard": str(WHOLE_RUN), "first": 0, "seed": np.uint64(described["seed"])}
    with MuonWriter(output, described, overwrite) as writer:
        if virtual:
            writer.refer([part.path for part in parts], progress)
        else:
            for part in parts:
                _copy(part, writer, progress)
    return int(total)


def _copy(part: _Part, writer: MuonWriter, progress: Callable[[int], object]) -> None:
    """Copy the muons of a shard, unless they are not those that were written to it."""
    found = dict.fromkeys(COLUMNS, 0)
    for muons in read_pieces(part.path, PIECE):
        found = {name: crc32(getattr(muons, name).data, so_far) for name, so_far in found.items()}
        writer.append(muons)
        progress(len(muons))
    for name, expected in read_checksums(part.path).items():
        if found[name] != expected:
            raise RefusedError(f"{part.path} is damaged: the column {name} {unlike(found[name], expected)}")


def _part(path: Path) -> _Part:
    attributes = read_attributes(path)
    missing = [name for name in NEEDED if name not in attributes]
    if missing:
        raise RefusedError(f"{path} is no shard of a run: it lacks the attribute {missing[0]}")
    for name in ("count", "first", "total", "seed"):
        if not isinstance(attributes[name], int):
            raise RefusedError(f"{path} is no shard of a run: its {name} is {attributes[name]!r}")
    return _Part(attributes["first"], attributes["first"] + attributes["count"], path, attributes)


def _check_same_run(part: _Part, other: _Part) -> None:
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
