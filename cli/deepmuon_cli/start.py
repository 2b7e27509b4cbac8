"""Where the commands start: before Python reads their modules, which takes a tenth of a second.

A signal that comes meanwhile ends a command at once, in one line: nothing has begun.
"""

from __future__ import annotations

# What the module signal is made of: that one, typing and types take 10 ms, in which a signal could come.
import _signal  # type: ignore[import-not-found]
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType
    from typing import NoReturn

__all__ = ["bake", "check", "convert", "gen", "merge", "plot"]

NAMES = {getattr(_signal, name): name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(_signal, name)}


def bake() -> NoReturn:
    """Run `deepmuon-bake`."""
    _start("bake")


def check() -> NoReturn:
    """Run `deepmuon-check`."""
    _start("check")


def convert() -> NoReturn:
    """Run `deepmuon-convert`."""
    _start("convert")


def gen() -> NoReturn:
    """Run `deepmuon-gen`."""
    _start("gen")


def merge() -> NoReturn:
    """Run `deepmuon-merge`."""
    _start("merge")


def plot() -> NoReturn:
    """Run `deepmuon-plot`."""
    _start("plot")


def _start(command: str) -> NoReturn:
    name = f"deepmuon-{command}"

    def leave(number: int, frame: FrameType | None) -> NoReturn:
        _leave(128 + number, f"{name}: stopped by {NAMES[number]}")

    for number in NAMES:
        if _signal.getsignal(number) != _signal.SIG_IGN:
            _signal.signal(number, leave)
    # No command multiplies matrices with NumPy; its library would start a thread for each processor all the same, and
    # raise SIGINT where the system refuses one.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from importlib import import_module

        main = import_module(f"deepmuon_cli.{command}").main
    except (ImportError, MemoryError) as error:
        _leave(1, f"{name}: can't be loaded: {' '.join(str(error).split()) or 'memory does not suffice'}")
    main()
    sys.exit()


def _leave(code: int, line: str) -> NoReturn:
    """End the process at once, whatever it was about to do."""
    os.write(2, f"{line}\n".encode("utf-8", "backslashreplace"))
    os._exit(code)
