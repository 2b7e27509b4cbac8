"""Tensors and numbers in a file with the checksum of its content: a damaged one is refused, not used."""

from __future__ import annotations

import hashlib
import io
import pickle
from pathlib import Path
from typing import Any

import torch

from deepmuon_runtime.errors import RefusedError, reason

__all__ = ["read_sealed", "seal"]

_NO_PARTS = (RuntimeError, pickle.UnpicklingError, EOFError, LookupError, TypeError, ValueError, AttributeError)
_HEAD = b"DeepMuon, SHA-256 of what follows "


def seal(parts: dict[str, Any]) -> bytes:
    """Return the content of a file: a line with a SHA-256, and what `torch.save` makes of the parts.

    Parameters
    ----------
    parts
        Numbers, texts, tensors, and lists and dictionaries of them.
    """
    contents = io.BytesIO()
    torch.save(parts, contents)
    content = contents.getvalue()
    return _HEAD + hashlib.sha256(content).hexdigest().encode() + b"\n" + content


def read_sealed(path: Path, what: str, instead: str) -> dict[str, Any]:
    """Return the parts that `seal` was given; nothing in the file is executed.

    Parameters
    ----------
    path
        The file.
    what
        It should be, in words that follow "is no".
    instead
        What to do about it.

    Raises
    ------
    RefusedError
        If the file can't be read, is none that `seal` made, or is damaged.
    """
    try:
        head, _, content = path.read_bytes().partition(b"\n")
        if not head.startswith(_HEAD):
            raise RefusedError(f"{path} is no {what}: {instead}")
        if hashlib.sha256(content).hexdigest().encode() != head.removeprefix(_HEAD):
            raise RefusedError(f"{path} is damaged, its content is not that of its checksum: {instead}")
        parts = torch.load(io.BytesIO(content), weights_only=True, map_location="cpu")
    except OSError as error:
        raise RefusedError(f"{path} is no {what}: {reason(error)}") from error
    except _NO_PARTS as error:
        raise RefusedError(f"{path} is no {what}: {instead}") from error
    if not isinstance(parts, dict):
        raise RefusedError(f"{path} is no {what}: {instead}")
    return parts
