"""Limits that a process sets itself, as far as the system has them (Windows has none of these)."""

from __future__ import annotations

import signal

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

__all__ = ["allow_computing", "forbid_memory_image", "is_memory_limited"]


def forbid_memory_image() -> None:
    """Leave no image of the memory behind when the process crashes."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def is_memory_limited() -> bool:
    """Tell whether the process may use less memory than there is (ulimit -v), so that little can be too much."""
    return resource is not None and resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


def allow_computing(seconds: float) -> None:
    """End the process by SIGPROF after so many seconds of computing from now on; 0 ends the limit."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)
