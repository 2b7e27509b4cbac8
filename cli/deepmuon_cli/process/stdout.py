"""Stdout that tells in one line what kept it from being written."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any, TextIO, cast

__all__ = ["watched_stdout"]


@contextmanager
def watched_stdout() -> Iterator[None]:
    """Let a fault of stdout, as on a full disk or when its reader has gone, raise FailedError instead of OSError."""
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
    """A text stream whose faults are FailedErrors."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with self._told():
            return self._stream.write(text)

    def flush(self) -> None:
        with self._told():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            from deepmuon_runtime.errors import FailedError, reason

            raise FailedError(f"stdout was not written to its end: {reason(error)}") from error
