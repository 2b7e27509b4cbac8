"""What a damaged HDF5 file does to those who read it."""

from __future__ import annotations

import h5py

__all__ = ["READ_ERRORS", "member"]

READ_ERRORS = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, MemoryError)
"""What h5py raises when a file is damaged."""


def member(group: h5py.Group, path: str) -> h5py.Group | h5py.Dataset | None:
    """Return what a group holds in the same file under a path, or None: a link to another file is not followed."""
    found = group
    try:
        for name in path.split("/"):
            if not isinstance(found, h5py.Group) or isinstance(found.get(name, getlink=True), h5py.ExternalLink):
                return None
            found = found.get(name)
    except READ_ERRORS:
        return None
    return found
