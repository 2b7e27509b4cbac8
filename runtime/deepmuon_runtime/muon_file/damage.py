"""What a damaged or hostile HDF5 file does to those who read it."""

from __future__ import annotations

import h5py

__all__ = ["READ_ERRORS", "member"]

READ_ERRORS = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, MemoryError)
"""What h5py raises when a file is damaged."""


def member(group: h5py.Group, path: str) -> h5py.Group | h5py.Dataset | None:
    """Return what a group itself holds under a path, or None.

    Only hard links are followed: an external link leads to another file, and a soft one may lead to an external one.
    """
    found = group
    try:
        for name in path.split("/"):
            if not isinstance(found, h5py.Group) or not isinstance(found.get(name, getlink=True), h5py.HardLink):
                return None
            found = found.get(name)
    except READ_ERRORS:
        return None
    return found
