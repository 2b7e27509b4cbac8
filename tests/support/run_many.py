"""Run a command many times: `python run_many.py check < lines`, where each line is a JSON list of arguments.

Prints a line for each: the exit code. Each runs in a fresh process, forked from one that has loaded the libraries
already. A code below 0 is the signal that ended the process; that of SIGALRM stands for one that did not end.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import signal
import sys
import traceback
from collections.abc import Callable

LIBRARIES = ("deepmuon_runtime", "onnxruntime")
LONGEST = 600  # s, on any machine


def exit_code(main: Callable[[], object], arguments: list[str]) -> int:
    """Run the command in a child, and return how the child ended."""
    child = os.fork()
    if child == 0:
        signal.alarm(LONGEST)
        sys.argv = ["the-command", *arguments]
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


for library in LIBRARIES:
    importlib.import_module(library)
command = importlib.import_module(f"deepmuon_cli.{sys.argv[1]}")
for line in sys.stdin:
    print(exit_code(command.main, json.loads(line)), flush=True)
