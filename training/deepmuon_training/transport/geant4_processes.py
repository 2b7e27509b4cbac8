"""Geant4 in processes of its own: what it is told, what it tells, and how the processes are run.

Geant4 allows one run manager per process, prints a lot and may crash while it shuts down. So a transport is
a folder that its processes share: ``job.json``, the primaries in ``primaries.npy``, and a file per finished
chunk of them. The files count, not the exit codes. The processes run `deepmuon_training.transport.geant4_slab`.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from deepmuon_runtime.errors import FailedError
from deepmuon_training.progress import progress_bar
from deepmuon_training.transport.geant4_data import without_data_sets

__all__ = ["CHUNK", "EXIT", "PRIMARY", "SlabJob", "chunk_file", "run_geant4", "sideways_file"]

CHUNK = 20_000
"""Primaries in a chunk. Each has a seed of its own, so that the result doesn't depend on who carries it."""

PRIMARY = np.dtype([("energy", "f4"), ("u", "f4"), ("v", "f4"), ("w", "f4"), ("pdg_id", "i1")])
"""A muon that enters the slab by its upper plane: kinetic energy [GeV], direction, PDG number."""

EXIT = np.dtype([("row", "i8"), ("energy", "f4"), ("u", "f4"), ("v", "f4"), ("w", "f4")])
"""A muon that leaves the slab by its upper or lower plane: its row among the primaries, kinetic energy [GeV],
direction."""

_SECONDS_BETWEEN_LOOKS = 0.1


@dataclass(frozen=True)
class SlabJob:
    """A slab to carry muons through.

    Parameters
    ----------
    material : str
        Name of what it is made of: one of Geant4's (NIST), or standard_rock.
    thickness : float
        Its thickness in m.
    seed : int
        Seed of the random numbers.
    density : float, optional
        Density of the material in g/cm3, if not its own.
    box : (float, float), optional
        Widths of the slab along x and y in m; a slab without them is infinite.
    """

    material: str
    thickness: float
    seed: int
    density: float | None = None
    box: tuple[float, float] | None = None

    def write(self, folder: Path) -> None:
        """Write ``job.json``."""
        (folder / "job.json").write_text(json.dumps(asdict(self)))

    @classmethod
    def read(cls, folder: Path) -> SlabJob:
        """Read ``job.json``."""
        return cls(**json.loads((folder / "job.json").read_text()))

    def chunk_seed(self, chunk: int) -> int:
        """Return the seed of one chunk, a 63-bit number."""
        return int(np.random.SeedSequence([self.seed, chunk]).generate_state(1, np.uint64)[0] >> np.uint64(1))


def chunk_file(folder: Path, chunk: int) -> Path:
    """Return the path of a finished chunk: an array of `EXIT`, in the order of the rows."""
    return folder / f"chunk-{chunk:06d}.npy"


def sideways_file(folder: Path, chunk: int) -> Path:
    """Return the path of the number of muons of a chunk that left the slab by its sides."""
    return folder / f"sideways-{chunk:06d}.npy"


def run_geant4(
    primaries: NDArray[np.void], job: SlabJob, processes: int, progress: bool
) -> tuple[NDArray[np.void], int]:
    """Carry muons through a slab in several processes.

    Parameters
    ----------
    primaries : PRIMARY [n]
        The muons.
    job : SlabJob
        The slab.
    processes : int
        How many processes to run, at most one per chunk.
    progress : bool
        Whether to draw a progress bar on stderr.

    Returns
    -------
    EXIT [m]
        The muons that left the slab by its upper or lower plane, in the order of the primaries.
    int
        How many left it by its sides.

    Raises
    ------
    FailedError
        If a process ends without its results.
    """
    chunks = math.ceil(len(primaries) / CHUNK)
    processes = min(processes, chunks)
    with tempfile.TemporaryDirectory(prefix="deepmuon-transport-") as name:
        folder = Path(name)
        job.write(folder)
        np.save(folder / "primaries.npy", primaries)
        bar = progress_bar(len(primaries), "Geant4", " muons", hidden=not progress)
        with bar, ExitStack() as running:
            shares = [range(first, chunks, processes) for first in range(processes)]
            _wait([running.enter_context(_Process(folder, share)) for share in shares], bar)
        found = [np.load(chunk_file(folder, chunk)) for chunk in range(chunks)]
        sideways = sum(int(np.load(sideways_file(folder, chunk))) for chunk in range(chunks))
    return np.concatenate([np.empty(0, EXIT), *found]), sideways


def _wait(processes: list[_Process], bar: tqdm) -> None:
    while not all([process.finished() for process in processes]):  # a list, to look at each of them
        done = CHUNK * sum(process.done for process in processes)
        bar.update(min(done, bar.total) - bar.n)
        time.sleep(_SECONDS_BETWEEN_LOOKS)
    bar.update(bar.total - bar.n)


class _Process:
    """A Geant4 process that carries some of the chunks, killed at the end of a with block."""

    def __init__(self, folder: Path, chunks: range) -> None:
        self.files = [chunk_file(folder, chunk) for chunk in chunks]
        self.done = 0  # how many of these are there
        self.log = folder / f"process-{chunks.start}.log"
        which = [str(number) for number in (chunks.start, chunks.stop, chunks.step)]
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "deepmuon_training.transport.geant4_slab", str(folder), *which],
                env=without_data_sets(),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def finished(self) -> bool:
        """Return whether it has ended with all its results."""
        ended = self.process.poll()
        while self.done < len(self.files) and self.files[self.done].exists():
            self.done += 1
        if ended is not None and self.done < len(self.files):
            said = " ".join(self.log.read_text(errors="replace").split())
            raise FailedError(f"a Geant4 process ended ({ended}) without its muons, saying: ... {said[-600:]}")
        return ended is not None

    def __enter__(self) -> _Process:
        return self

    def __exit__(self, *exception: object) -> None:
        self.process.kill()
        self.process.wait()
