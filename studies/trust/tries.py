"""What every try of a campaign starts from, and what has to hold at its end."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import numpy as np
from support.commands import command_line
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, check_file
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX

__all__ = ["MUONS", "FaultError", "Inputs", "Random", "ended", "see", "see_line", "see_outputs", "see_same", "start"]

MUONS = 300_000  # of a run that is disturbed
LONGEST = 600  # s of a command
Random = np.random.Generator


class FaultError(Exception):
    """What should not have happened."""


class Inputs:
    """What the tries start from: a model, and a muon file that it made."""

    def __init__(self, folder: Path) -> None:
        self.model = folder / "model.onnx"
        self.model.write_bytes(tiny_model())
        self.muons = folder / "muons.h5"
        self.generator = Generator.open(file=self.model, device="cpu")
        self.generator.write(self.muons, MUONS, seed=1)
        self.duration = self._duration(folder)

    def commands(self) -> list[tuple[str, list[object]]]:
        """Return the words of each command; each writes `output` but check."""
        make = ["--model", self.model, "-n", MUONS, "--seed", 1, "--threads", 16, "-q", "-o", "output.h5"]
        return [
            ("gen", make),
            ("check", [self.muons]),
            ("convert", [self.muons, "output.csv"]),
            ("merge", [self.muons, "-q", "-o", "output.h5"]),
            ("plot", [self.muons, "-o", "output.png"]),
        ]

    def _duration(self, folder: Path) -> float:
        """Return how long the longest of them takes, in s."""
        began = time.monotonic()
        subprocess.run(command_line("plot", self.muons, "-o", "muons.png"), cwd=folder, check=True)
        return time.monotonic() - began


def start(command: str, words: list[object], folder: Path, **options: object) -> subprocess.Popen[str]:
    """Start a command in a folder."""
    line = command_line(command, *words)
    return subprocess.Popen(line, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **options)


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for a command, and its child: exit code, stderr."""
    _, err = process.communicate(timeout=LONGEST)
    return process.returncode, err


def see(holds: bool, text: str) -> None:
    """Raise FaultError with the text unless something holds."""
    if not holds:
        raise FaultError(text)


def see_outputs(folder: Path, is_killed: bool = False) -> None:
    """See that what has the name of an output is complete, and that nothing else was left."""
    for path in folder.glob("output*"):
        if path.name.endswith(PARTIAL_SUFFIX):
            see(is_killed, f"{path.name} was left")
        elif path.suffix == ".h5":
            see(check_file(path).defects == [], f"{path.name} has defects")
        elif path.suffix == ".onnx":
            Generator.open(file=path, device="cpu")  # a refusal is a fault
        else:
            content = path.read_bytes()
            lines = [line for line in content.splitlines() if not line.startswith(b"#")]
            is_whole = len(lines) == MUONS + 1 if path.suffix == ".csv" else content[-8:-4] == b"IEND"
            see(is_whole, f"{path.name} is not complete")


def see_line(code: int, err: str) -> None:
    """See that a command which did not succeed said why in one line."""
    see("Traceback" not in err, f"a traceback: {err}")
    see(err.count("\n") == (code != 0), f"exit code {code} and {err!r}")


def see_same(found: object, expected: object, what: str) -> None:
    """See that two sets of muons are the same to the last bit."""
    for name in ("kinetic_energy", "u", "v", "w", "pdg_id"):
        see(np.array_equal(getattr(found, name), getattr(expected, name)), f"{what}: another {name}")
