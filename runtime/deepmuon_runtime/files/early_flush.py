"""Bringing a growing file to the disk while it grows."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress

from deepmuon_runtime.files.flush import flush, flush_data

__all__ = ["EarlyFlush"]

STEP = 1 << 26  # bytes between two flushes: what is left for the last one takes a disk a moment


class EarlyFlush:
    """Flushes a file in a thread of its own, again and again, so that the last flush finds little left to do.

    Without it the operating system keeps up to a fifth of the memory for itself before it begins to write, and
    the process waits for all of that at its end.

    Parameters
    ----------
    descriptor
        Of an open file. It must stay open until `close` returns.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting = 0
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="early-flush")
        self._flush: Future[None] | None = None

    def wrote(self, size: int) -> None:
        """Take note of bytes that were written; flush when there are many, unless a flush is under way.

        Raises
        ------
        OSError
            If an earlier flush failed. The system tells of such an error only once.
        """
        self._waiting += size
        if self._waiting < STEP or (self._flush is not None and not self._flush.done()):
            return
        self._raise_failure()
        self._waiting = 0
        with suppress(RuntimeError):  # the system starts no thread for it: the last flush has more to do
            self._flush = self._thread.submit(flush_data, self._descriptor)

    def finish(self) -> None:
        """Wait until all that was written is on the disk.

        Raises
        ------
        OSError
            If that fails, or an earlier flush has.
        """
        self._raise_failure()
        flush(self._descriptor)

    def close(self) -> None:
        """Wait for a flush that is under way, and end the thread."""
        self._thread.shutdown(cancel_futures=True)

    def _raise_failure(self) -> None:
        if self._flush is not None:
            self._flush.result()
