"""Run `deepmuon-check` on each file named on stdin: `python check_many.py < names`. Prints an exit code a line.

Each file is checked in a fresh process, forked from one that has loaded the libraries already. A code below 0 is the
signal that ended the process; that of SIGALRM stands for one that did not end.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import traceback

import deepmuon_runtime.check  # noqa: F401 - for all children
from deepmuon_cli.check import main

LONGEST = 600  # s, on any machine


def exit_code(path: str) -> int:
    """Check a file in a child, and return how the child ended."""
    child = os.fork()
    if child == 0:
        signal.alarm(LONGEST)
        sys.argv = ["deepmuon-check", path]
        code = 1
        try:
            with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
                main()
        except SystemExit as ended:
            code = int(ended.code or 0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


for line in sys.stdin:
    print(exit_code(line.rstrip("\n")))
