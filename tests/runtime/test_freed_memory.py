"""Whether memory that was given back stays in the process."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have their own ways")

# Twenty times 40 arrays of 64 pages each; at the end, how many pages the system gave.
PROGRAM = """
import resource
import numpy as np
from deepmuon_runtime.freed_memory import keep_freed_memory

{first}
def work():
    for _ in range(20):
        arrays = [np.ones(1 << 16, np.float32) for _ in range(40)]
        del arrays

work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def pages_given(first: str) -> int:
    done = subprocess.run([sys.executable, "-c", PROGRAM.format(first=first)], capture_output=True, check=True)
    return int(done.stdout)


def test_memory_that_was_freed_is_not_asked_of_the_system_again():
    assert pages_given("keep_freed_memory()") < 1000
    assert pages_given("") > 10_000


def test_where_addresses_are_limited_nothing_is_kept():
    limited = "resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30)); keep_freed_memory()"
    assert pages_given(limited) > 1000
