"""The process that started this one, without which this one should not go on."""

from __future__ import annotations

import ctypes
import os
import signal
from contextlib import suppress

__all__ = ["Parent"]

PR_SET_PDEATHSIG = 1
"""Of prctl: which signal this process gets when its parent has ended. Source: linux/prctl.h."""


class Parent:
    """The parent of a process that was just forked; Linux stops the child as soon as the parent has ended.

    Parameters
    ----------
    number
        Its process number, as it was before the fork.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        with suppress(OSError, AttributeError):  # a C library that can't be loaded, or has no prctl
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)

    def check(self) -> None:
        """See that it is still there: on other systems nothing else stops an orphan.

        Raises
        ------
        FailedError
            If it has ended.
        """
        if os.getppid() != self._number:
            from deepmuon_runtime.errors import FailedError

            raise FailedError("the process that should have waited for this one was killed: nothing is written")
