"""How a command ends: its exit code, and one line that says why.

=====  ===========================================================================================
0      done
1      failed while running: disk full, the model gave a bad muon, lost a race for the output,
       stdout not written to its end
2      refused before anything started: bad arguments, no such model, bad input, output exists
3      `deepmuon-check` found a defect
129    stopped by SIGHUP: the terminal or the connection was closed
130    stopped by Ctrl-C
141    nobody read stdout to its end, as before `| head`; nothing is said
143    stopped by SIGTERM
128+n  ended by another signal, of number n
=====  ===========================================================================================
"""

from __future__ import annotations

import signal
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any, NoReturn

import click

from deepmuon_cli.process.lack import lack
from deepmuon_cli.process.limits import is_memory_limited
from deepmuon_cli.process.signals import Echo, answer, ignore, let_through
from deepmuon_cli.process.stdout import ReaderGoneError, watched_stdout

__all__ = ["DEFECTIVE", "FAILED", "REFUSED", "complain", "run"]

FAILED = 1
REFUSED = 2
DEFECTIVE = 3

MOMENT = 0.02  # s, after which a signal that got lost comes again


def run(command: click.Command, name: str) -> NoReturn:
    """Run a command on the arguments of the process, and end the process.

    Parameters
    ----------
    command
        What to run.
    name
        What the user typed to start it.
    """
    warnings.showwarning = lambda message, *_, **__: _say(f"{name}: warning:", message, "yellow")
    code, reason = _Stopping().outcome(lambda: _outcome(command, name))
    if reason:
        complain(name, reason)
    sys.exit(code)


def complain(name: str, reason: str) -> None:
    """Write the line that says why a command does not end with 0."""
    _say(f"{name}:", reason, "red")


def _say(beginning: str, message: object, colour: str) -> None:
    """Write a line to stderr; click leaves the colour out where that is no terminal."""
    with suppress(OSError):  # a terminal that was closed, a full disk: the exit code has to do
        click.echo(f"{click.style(beginning, fg=colour)} {_printable(message)}", err=True)


def _printable(message: object) -> str:
    """Return a text whose control characters, which a stranger's file may bring, are escaped."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in str(message))


class _Stopped(BaseException):
    """A signal asked the process to end."""

    def __init__(self, lost: Callable[[], None]) -> None:
        super().__init__()
        self._lost = lost

    def __del__(self) -> None:
        self._lost()


class _Stopping:
    """Turns a signal into an exception in the main thread, so that temporary files are removed on its way.

    A second signal does not disturb that. But Python drops an exception that is raised while an object is
    destroyed, and a library may drop one that is raised in its callback. An exception that was dropped is
    destroyed before it arrived: then the signal comes again a moment later.
    """

    def __init__(self) -> None:
        self._number: int | None = None  # the first signal
        self._is_quiet = False  # an exception is on its way, or all is done
        self._is_done = False
        self._echo = Echo(self._stop)
        self._report_unraisable = sys.unraisablehook

    def outcome(self, function: Callable[[], tuple[int, str]]) -> tuple[int, str]:
        """Return what a function returns, or the exit code and the reason of a stop."""
        try:
            self._begin()
            result = function()
            self._end()
            return result
        except BaseException:
            self._end()
            if self._number is None:
                raise
            return 128 + self._number, f"stopped by {signal.Signals(self._number).name}"

    def _begin(self) -> None:
        sys.unraisablehook = self._unraisable
        answer(self._stop)
        let_through()

    def _end(self) -> None:
        self._is_quiet = self._is_done = True
        self._echo.end()
        ignore()

    def _stop(self, number: int, frame: FrameType | None) -> None:
        if self._is_quiet:
            return
        self._is_quiet = True
        if self._number is None:
            self._number = number
        raise _Stopped(self._lost)

    def _lost(self) -> None:
        if not self._is_done:
            self._is_quiet = False
            self._echo.sound(MOMENT)

    def _unraisable(self, unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, _Stopped):
            self._report_unraisable(unraisable)


def _outcome(command: click.Command, name: str) -> tuple[int, str]:
    """Return the exit code, and the reason where there is one."""
    try:
        with watched_stdout():
            code = command.main(prog_name=name, standalone_mode=False)  # that of click.Context.exit, or None
    except click.ClickException as error:
        if isinstance(error, click.NoSuchOption) and error.possibilities:
            del error.possibilities[1:]  # after the nearest come distant ones
        return REFUSED, " ".join(error.format_message().split())
    except ReaderGoneError:
        return 128 + signal.SIGPIPE, ""
    except Exception as error:
        known = sys.modules.get("deepmuon_runtime.errors")  # without it, nobody has raised one of its errors
        is_known = known is not None and isinstance(error, known.DeepMuonError)
        lacking = lack(error)
        # A damaged file may ask for any memory: only where there is a limit an error of it is no fault of the file.
        if lacking and (is_memory_limited() or not is_known):
            return FAILED, lacking
        if known is not None and is_known:
            return (REFUSED if isinstance(error, known.RefusedError) else FAILED), str(error)
        if isinstance(error, OSError):  # a folder that vanished at that moment
            return FAILED, str(error)
        raise
    return code or 0, ""
