"""Stdout that tells in one line what kept it from being written."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any, TextIO, cast

__all__ = ["ReaderGoneError", "told_faults", "watched_stdout"]


class ReaderGoneError(Exception):
    """Nobody reads stdout any more, as after `| head`: no fault, but there is no more to do."""


@contextmanager
def told_faults() -> Iterator[None]:
    """Turn a fault of stdout into FailedError, or into ReaderGoneError where its reader has gone."""
    try:
        yield
    except BrokenPipeError as error:
        raise ReaderGoneError from error
    except OSError as error:
        from deepmuon_runtime.errors import FailedError, reason

        raise FailedError(f"stdout was not written to its end: {reason(error)}") from error


@contextmanager
def watched_stdout() -> Iterator[None]:
    """Let a fault of stdout raise FailedError instead of OSError, as on a full disk, or ReaderGoneError."""
    if sys.stdout is None:  # closed by who started the process
        yield
        return
    stdout = sys.stdout
    watched = _Watched(stdout)
    try:
        with redirect_stdout(cast(TextIO, watched)):
            yield
            watched.flush()
    finally:
        _drop_what_fails(stdout)


def _drop_what_fails(stream: TextIO) -> None:
    """Throw away what can't be written, which Python would try once more when it ends, and complain of."""
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class _Watched:
    """A text stream whose faults are FailedErrors, or ReaderGoneErrors."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with told_faults():
            return self._stream.write(text)

    def flush(self) -> None:
        with told_faults():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
