"""The signals that ask a command to end, as far as the system has them.

Windows knows Ctrl-C and SIGTERM alone, can't hold a signal back, and has no timer that sends one.
"""

from __future__ import annotations

import _thread
import signal
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import threading

__all__ = ["SIGNALS", "Echo", "answer", "hold_back", "ignore", "let_through", "those_of"]


def those_of(*names: str) -> tuple[signal.Signals, ...]:
    """Return the signals of these names that the system has."""
    return tuple(getattr(signal, name) for name in names if hasattr(signal, name))


SIGNALS = those_of("SIGINT", "SIGTERM", "SIGHUP")

Handler = Callable[[int, FrameType | None], object]


def answer(handler: Handler) -> None:
    """Let a function answer them, but those ignored from the beginning, as in the background or by nohup."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def ignore() -> None:
    """Pass over them from now on, even while Python ends: the exit code stands."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def hold_back() -> None:
    """Keep them waiting until `let_through`, here and in a process that is forked meanwhile."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)


def let_through() -> None:
    """Deliver those that wait, and those to come."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


class Echo:
    """Calls a signal's handler again a moment after a signal, in the main thread.

    Parameters
    ----------
    handler
        What answers SIGINT.
    """

    def __init__(self, handler: Handler) -> None:
        self._handler = handler
        self._timer: threading.Timer | None = None

    def sound(self, seconds: float) -> None:
        """Call the handler once, so long after now."""
        if hasattr(signal, "setitimer"):
            signal.signal(signal.SIGALRM, self._handler)
            signal.setitimer(signal.ITIMER_REAL, seconds)
        else:
            import threading

            self._timer = threading.Timer(seconds, _thread.interrupt_main)
            self._timer.daemon = True
            self._timer.start()

    def end(self) -> None:
        """Call it no more."""
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
        elif self._timer is not None:
            self._timer.cancel()
