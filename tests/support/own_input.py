"""Whether a command replaces what it reads, under whatever name, and asked to overwrite as it may be."""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

__all__ = ["assert_own_input_is_refused"]

SCRIPTS = Path(sysconfig.get_path("scripts"))


def assert_own_input_is_refused(folder: Path, words: str, output: str, suffix: str = ".png") -> None:
    """Run a command, `{}` in it being its input, with that, or a link to it, as output too."""
    source = folder / f"input{suffix}"
    source.write_text("precious")
    (folder / f"link{suffix}").symlink_to(source)
    command = words.format(source.name)
    option = "" if command.endswith("--json") or command.startswith("deepmuon-convert ") else "-o"
    name, *rest = f"{command} {option} {output}{suffix} --overwrite".split()
    done = subprocess.run([SCRIPTS / name, *rest], cwd=folder, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (2, "")
    assert (
        done.stderr == f"{name}: {output}{suffix} is read here, and would be replaced: give the output another name\n"
    )
    assert source.read_text() == "precious"
    assert len(list(folder.iterdir())) == 2
