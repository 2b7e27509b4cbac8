"""Another system than the one at hand: a program runs without the modules and calls that Windows or macOS lacks.

    python lesser_system.py windows PROGRAM [ARGUMENT]...
    python lesser_system.py macos PROGRAM [ARGUMENT]...

PROGRAM is a command of the package, as gen, or a file of Python. What is taken away is what the package itself may use:
`os.name` stays, because Python's own modules go by it.
"""

from __future__ import annotations

import ctypes
import errno
import os
import runpy
import signal
import subprocess
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

__all__ = ["FULL_FLUSH"]

FULL_FLUSH = 51
"""F_FULLFSYNC of macOS."""


class Missing(MetaPathFinder):
    """Lets the import of some modules fail."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names

    def find_spec(self, name: str, path: object = None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name in self._names:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None


def take_modules_away(*names: str) -> None:
    sys.meta_path.insert(0, Missing(names))
    for name in names:
        sys.modules.pop(name, None)


def take_calls_away(module: ModuleType, *names: str) -> None:
    for name in names:
        if hasattr(module, name):
            delattr(module, name)


class LibraryWithoutPrctl(ctypes.CDLL):
    def __getattr__(self, name: str) -> object:
        if name == "prctl":
            raise AttributeError(name)
        return super().__getattr__(name)


def become_windows() -> None:
    subprocess.run([sys.executable, "-c", ""], check=True)  # what it needs later, it has now
    take_modules_away("fcntl", "resource", "pwd", "grp")
    take_calls_away(os, "fork", "link", "fdatasync", "sched_getaffinity", "O_NOFOLLOW", "O_NONBLOCK", "O_PATH")
    take_calls_away(signal, "SIGHUP", "SIGALRM", "SIGPROF", "SIGBUS", "setitimer", "pthread_sigmask", "ITIMER_REAL")
    os.supports_dir_fd.clear()
    os.supports_fd.clear()
    replace, is_open = os.replace, os.open

    def replace_closed(source: str, target: str) -> None:
        """Refuse what Windows refuses: another name for an open file."""
        wanted = os.stat(source)
        for number in os.listdir("/proc/self/fd"):
            try:
                found = os.stat(f"/proc/self/fd/{number}")
            except OSError:  # that of the list itself
                continue
            if os.path.samestat(found, wanted):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), source)
        replace(source, target)

    def open_file(path: str, *arguments: int, **options: int) -> int:
        if os.path.isdir(path):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)
        return is_open(path, *arguments, **options)

    os.replace, os.open = replace_closed, open_file


def become_macos() -> None:
    """Forks, but knows no prctl, and flushes by fcntl; link is answered by ENOTSUP, 45 there, as by a network."""
    import fcntl

    take_calls_away(os, "fdatasync", "sched_getaffinity", "O_PATH")
    ctypes.CDLL = LibraryWithoutPrctl
    fcntl.F_FULLFSYNC = FULL_FLUSH

    def link(*arguments: object, **options: object) -> None:
        raise OSError(45, "Operation not supported")

    os.link = link


if __name__ == "__main__":
    system, program, *arguments = sys.argv[1:]
    {"windows": become_windows, "macos": become_macos}[system]()
    sys.argv = [program, *arguments]
    if program.endswith(".py"):
        runpy.run_path(program, run_name="__main__")
    else:
        from deepmuon_cli import start

        getattr(start, program)()
