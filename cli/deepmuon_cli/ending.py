"""How a command ends: its exit code, and one line that says why.

====  ===========================================================================================
0     done
1     failed while running: disk full, the model gave a bad muon, lost a race for the output
2     refused before anything started: bad arguments, no such depth, bad input, output exists
3     `deepmuon-check` found a defect
130   stopped by Ctrl-C
143   stopped by SIGTERM
====  ===========================================================================================
"""

from __future__ import annotations

import signal
import sys
import warnings
from types import FrameType
from typing import NoReturn

import click

__all__ = ["DEFECTIVE", "run"]

FAILED = 1
REFUSED = 2
DEFECTIVE = 3
SIGNALS = (signal.SIGINT, signal.SIGTERM)


def run(command: click.Command, name: str) -> NoReturn:
    """Run a command on the arguments of the process, and end the process.

    Parameters
    ----------
    command
        What to run.
    name
        What the user typed to start it.
    """
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as for a job in the background
            signal.signal(number, _stop)
    warnings.showwarning = lambda message, *_, **__: click.echo(f"{name}: warning: {message}", err=True)
    code, reason = _outcome(command, name)
    if reason:
        click.echo(f"{name}: {reason}", err=True)
    sys.exit(code)


class _Stopped(BaseException):
    """A signal asked the process to end."""


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    """Unwind, so that temporary files are removed, and let no second signal disturb that."""
    for other in SIGNALS:
        signal.signal(other, signal.SIG_IGN)
    raise _Stopped(number)


def _outcome(command: click.Command, name: str) -> tuple[int, str]:
    """Return the exit code, and the reason where there is one."""
    try:
        code = command.main(prog_name=name, standalone_mode=False)  # that of click.Context.exit, or None
    except click.ClickException as error:
        return REFUSED, " ".join(error.format_message().split())
    except _Stopped as stopped:
        number = stopped.args[0]
        return 128 + number, f"stopped by {signal.Signals(number).name}"
    except Exception as error:
        from deepmuon_runtime.errors import FailedError, RefusedError

        if isinstance(error, (FailedError, RefusedError)):
            return (REFUSED if isinstance(error, RefusedError) else FAILED), str(error)
        raise
    return code or 0, ""
