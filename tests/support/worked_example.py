"""The worked example in a command's help: lines `$ COMMAND`, each followed by what it prints."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

__all__ = ["run_example"]

EXAMPLE = re.compile(r"^ +\$ .*\n(?: +\S.*\n)*", re.MULTILINE)


def run_example(folder: Path, command: str) -> tuple[str, str]:
    """Return the example in the help of a command, and the same with what its lines print in a folder."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}

    def printed(line: str) -> str:
        options = {"cwd": folder, "env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        return subprocess.run(["bash", "-c", line], text=True, timeout=120, check=True, **options).stdout

    found = EXAMPLE.search(printed(f"COLUMNS=100 {command} --help"))
    assert found is not None, f"the help of {command} has no example"
    lines = [line.strip() for line in found[0].splitlines()]
    shown = [f"{line}\n{printed(line[2:])}" for line in lines if line.startswith("$ ")]
    return "\n".join(lines) + "\n", "".join(shown)
