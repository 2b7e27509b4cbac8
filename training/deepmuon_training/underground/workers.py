"""Processes that carry muons back side by side: mulder holds Python's lock."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from contextlib import ExitStack, suppress
from queue import SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import FailedError
from deepmuon_training.underground.mulder_carrier import MIXED, Origins, carry_back
from deepmuon_training.underground.overburden import Overburden

__all__ = ["Workers"]

Float = NDArray[np.float64]


class Workers:
    """Processes to carry muons back, until the end of a with block; where one is enough, this process does it.

    Parameters
    ----------
    overburden
        That the muons go through; mulder's tables of it are made here, before the processes begin.
    number
        Of processes.

    Raises
    ------
    RefusedError
        If mulder is not installed.
    """

    def __init__(self, overburden: Overburden, number: int) -> None:
        carry_back(overburden, MIXED, 1.0, np.ones(1), np.ones(1), 0)
        self.number = number
        self._overburden = overburden
        self._idle: SimpleQueue[_Worker] = SimpleQueue()
        self._running = ExitStack()

    def carry_back(self, mode: str, depth: float, energy: Float, cos_zenith: Float, seed: int) -> Origins:
        """Do as `deepmuon_training.underground.mulder_carrier.carry_back` in the next idle process.

        As many threads as there are processes can do so at a time.

        Raises
        ------
        FailedError
            If the process ends.
        """
        if self.number == 1:
            return carry_back(self._overburden, mode, depth, energy, cos_zenith, seed)
        worker = self._idle.get()
        try:
            return worker.do(self._overburden, mode, depth, energy, cos_zenith, seed)
        finally:
            self._idle.put(worker)

    def __enter__(self) -> Workers:
        """Start the processes."""
        for _ in range(self.number if self.number > 1 else 0):
            self._idle.put(self._running.enter_context(_Worker()))
        return self

    def __exit__(self, *exception: object) -> None:
        """End them."""
        self._running.close()


class _Worker:
    """A process that answers calls of `carry_back`, killed at the end of a with block."""

    def __init__(self) -> None:
        program = [sys.executable, "-m", "deepmuon_training.underground.workers"]
        self._process = subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def do(self, *call: Any) -> Origins:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            pickle.dump(call, self._process.stdin, protocol=5)
            self._process.stdin.flush()
            return Origins(*pickle.load(self._process.stdout))
        except (OSError, EOFError, pickle.UnpicklingError) as error:
            raise FailedError(f"a process of mulder ended ({self._process.wait()}) without its muons") from error

    def __enter__(self) -> _Worker:
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.kill()
        self._process.communicate()


def main() -> None:
    """Answer the calls on stdin, until there are no more: it ends with the process that calls, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent as well, which ends this process
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anything prints is no answer
    with suppress(EOFError, BrokenPipeError, pickle.UnpicklingError):  # nobody asks, or waits, any more
        while True:
            call = pickle.load(sys.stdin.buffer)
            pickle.dump(tuple(carry_back(*call)), answers, protocol=5)
            answers.flush()


if __name__ == "__main__":
    main()
