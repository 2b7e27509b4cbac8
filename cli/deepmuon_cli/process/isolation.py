"""A command in a process of its own, for what a library may do to its process when a file is damaged.

HDF5 ends the process by a segmentation fault, or computes for ever, on some damaged files.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
from contextlib import suppress
from types import FrameType
from typing import NoReturn

import click

from deepmuon_cli.process.ending import REFUSED, SIGNALS, complain, run

__all__ = ["run_isolated", "show_life", "take_time"]

PATIENCE = 10.0  # s of computing

OF_DAMAGE = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL, signal.SIGPROF)
"""What ends a process that trusts a damaged file; other signals come from outside."""


def run_isolated(command: click.Command, name: str) -> NoReturn:
    """Run a command as `ending.run` does, but one that crashes or never ends has refused its input.

    The command has to call `show_life` from time to time. Call this before any thread starts.

    Parameters
    ----------
    command, name
        As for `deepmuon_cli.process.ending.run`.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # until there is somebody to answer them
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # no memory image for a file that was expected to be damaged
        show_life()
        run(command, name)

    def pass_on(number: int, frame: FrameType | None) -> None:
        with suppress(ProcessLookupError):  # it has just ended
            os.kill(child, number)

    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, pass_on)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if -code in SIGNALS:  # it came when all was done
        code = 128 - code
    elif -code in OF_DAMAGE:
        ending = "took no end" if -code == signal.SIGPROF else f"was ended by {signal.Signals(-code).name}"
        complain(name, f"a file is damaged so that reading it {ending}")
        code = REFUSED
    elif code < 0:
        hint = ", as the system does when memory runs out" if -code == signal.SIGKILL else ""
        complain(name, f"ended from outside by signal {-code}, {signal.strsignal(-code)}{hint}")
        code = 128 - code
    sys.exit(code)


def show_life() -> None:
    """Ask for another ten seconds of computing, after which the process is ended by SIGPROF."""
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)


def take_time() -> None:
    """End the limit of computing: nothing that may be damaged is read any more."""
    signal.setitimer(signal.ITIMER_PROF, 0)
