"""A command in a process of its own, for what a library may do to its process when a file is damaged.

HDF5 ends the process by a segmentation fault, or computes for ever, on some damaged files.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from functools import wraps
from types import FrameType
from typing import NoReturn

import click

from deepmuon_cli.process.ending import FAILED, REFUSED, complain, run
from deepmuon_cli.process.lack import THREADS, lack
from deepmuon_cli.process.limits import allow_computing, forbid_memory_image
from deepmuon_cli.process.parent import Parent
from deepmuon_cli.process.signals import answer, hold_back, ignore, let_through, those_of

__all__ = ["run_isolated", "show_life", "take_time"]

PATIENCE = 10.0  # s of computing

OF_DAMAGE = those_of("SIGSEGV", "SIGBUS", "SIGABRT", "SIGFPE", "SIGILL", "SIGPROF")
"""What ends a process that trusts a damaged file; other signals come from outside."""

_parent: Parent | None = None  # of the process in which the command runs


def run_isolated(command: click.Command, name: str) -> NoReturn:
    """Run a command as `ending.run` does, but one that crashes or never ends has refused its input.

    The command has to call `show_life` from time to time. Call this before any thread starts. Where the system can't
    fork (Windows), the command runs in this process, and a crash is what it is.

    Parameters
    ----------
    command, name
        As for `deepmuon_cli.process.ending.run`.
    """
    if not hasattr(os, "fork"):
        run(command, name)
    hold_back()  # until there is somebody to answer the signals
    number = os.getpid()
    try:
        child = os.fork()
    except OSError as error:
        ignore()
        complain(name, THREADS if isinstance(error, BlockingIOError) else lack(error) or str(error))
        sys.exit(FAILED)
    if child == 0:
        _run_as_child(command, name, Parent(number))
    sys.exit(_wait(child, name))


def _run_as_child(command: click.Command, name: str, parent: Parent) -> NoReturn:
    global _parent
    _parent = parent
    work = command.callback
    assert work is not None

    @wraps(work)
    def work_for_parent(*arguments: object, **options: object) -> object:
        from deepmuon_runtime.files.publish import CONDITIONS

        CONDITIONS.append(parent.check)
        return work(*arguments, **options)

    command.callback = work_for_parent
    forbid_memory_image()  # for a file that was expected to be damaged
    allow_computing(PATIENCE)
    run(command, name)


def _wait(child: int, name: str) -> int:
    """Pass signals on to the process of the command until it ends, and return the exit code."""

    def pass_on(number: int, frame: FrameType | None) -> None:
        with suppress(ProcessLookupError):  # it has just ended
            os.kill(child, number)

    answer(pass_on)
    let_through()
    _, status = os.waitpid(child, 0)
    ignore()
    code = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return code
    if -code in OF_DAMAGE:
        ending = "took no end" if -code == signal.SIGPROF else f"was ended by {signal.Signals(-code).name}"
        complain(name, f"a file is damaged so that reading it {ending}")
        return REFUSED
    hint = ", as the system does when memory runs out" if -code == signal.SIGKILL else ""
    complain(name, f"ended from outside by signal {-code}, {signal.strsignal(-code)}{hint}")
    return 128 - code


def show_life() -> None:
    """Ask for another ten seconds of computing, after which the process is ended by SIGPROF.

    Raises
    ------
    FailedError
        If nobody waits for this process any more.
    """
    if _parent is not None:
        _parent.check()
    allow_computing(PATIENCE)


def take_time() -> None:
    """End the limit of computing: nothing that may be damaged is read any more."""
    allow_computing(0)
