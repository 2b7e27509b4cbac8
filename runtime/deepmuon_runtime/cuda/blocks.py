"""Muons of a model by their numbers, made in a GPU's memory block by block."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from deepmuon_runtime.cuda.device_run import DeviceRun
from deepmuon_runtime.errors import FailedError, RefusedError, first_line
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import check_physical

if TYPE_CHECKING:
    import onnxruntime

    from deepmuon_runtime.model.metadata import Model

__all__ = ["INSTALL", "DeviceBlocks"]

INSTALL = "pip install 'deepmuon-runtime[cuda]'"
"""What brings CuPy."""

BLOCK = 1 << 22
"""Muons of one run of the network, about: a GPU wants so many at once."""


class DeviceBlocks:
    """Muons of a model on CUDA, of which nothing comes from the processor.

    They are those of the processor to float32 rounding, whatever the blocks.

    Parameters
    ----------
    session, model
        As `load_model` gives them, on CUDA.
    """

    def __init__(self, session: onnxruntime.InferenceSession, model: Model) -> None:
        self._session, self._model = session, model
        self._draws = -(-BLOCK // model.muons_per_draw)
        self._own = threading.local()  # each thread's memory for its runs

    @property
    def muons(self) -> int:
        """The muons of a block."""
        return self._draws * self._model.muons_per_draw

    def empty(self, n: int) -> Muons:
        """Return n muons in the GPU's memory, to be filled.

        Raises
        ------
        RefusedError
            If it does not hold them.
        """
        import cupy

        try:
            energy, u, v, w = (cupy.empty(n, np.float32) for _ in range(4))
            return Muons(energy, u, v, w, cupy.empty(n, np.int8))
        except (MemoryError, ValueError, cupy.cuda.memory.OutOfMemoryError) as error:
            raise RefusedError(_no_room(n)) from error

    def copied(self, muons: Muons) -> Muons:
        """Return muons of the computer's memory in the GPU's.

        Raises
        ------
        RefusedError
            If it does not hold them.
        """
        import cupy

        try:
            return Muons(**{name: cupy.asarray(column) for name, column in muons.columns.items()})
        except (MemoryError, cupy.cuda.memory.OutOfMemoryError) as error:
            raise RefusedError(_no_room(len(muons))) from error

    def empty_on_host(self, n: int) -> Muons:
        """Return n muons in the computer's memory, to be filled; in pages that a GPU copies to at once."""
        from cupyx import empty_pinned

        energy, u, v, w = (empty_pinned(n, np.float32) for _ in range(4))
        return Muons(energy, u, v, w, empty_pinned(n, np.int8))

    def fill(self, muons: Muons, seed: int, first: int, stopped: Callable[[], object]) -> None:
        """Make the muons from number `first` on, in either memory.

        Parameters
        ----------
        muons
            What is to be filled: of CuPy's arrays, or of numpy's, to which they are copied.
        seed
            0 to 2^64 - 1.
        first
            Number of the first.
        stopped
            Called before each block; it may raise.

        Raises
        ------
        FailedError
            If the model fails, or gives an unphysical muon.
        """
        import cupy

        is_here = not isinstance(muons.kinetic_energy, cupy.ndarray)
        done = 0
        while done < len(muons):
            stopped()
            block, skipped = divmod(first + done, self.muons)
            part = muons[done : done + self.muons - skipped]
            try:
                run, there = self._thread_run()
                made = there[: len(part)] if is_here else part
                bad = run.fill(made, seed, self._model.stream, block, skipped)
            except Exception as error:  # of ONNX Runtime and CuPy, which have no common base
                raise FailedError(f"the model {self._model.name} failed on the GPU: {first_line(error)}") from error
            if bad is not None:
                self._refuse(made[bad : bad + 1], first + done + bad)
            if is_here:
                for name, column in made.columns.items():
                    column.get(out=part.columns[name])  # type: ignore[attr-defined] # CuPy's
            done += len(part)

    def _refuse(self, muon: Muons, number: int) -> None:
        """Raise the error of a bad muon, in the words that there are for muons here."""
        here = Muons(**{name: column.get() for name, column in muon.columns.items()})  # type: ignore[attr-defined]
        check_physical(here, self._model.energy_min_gev, self._model.energy_max_gev, number)
        raise FailedError(f"the model gave a bad muon: number {number}, of which the processor finds no fault")

    def _thread_run(self) -> tuple[DeviceRun, Muons]:
        """Return the run of blocks that belongs to this thread, and muons of a block to be copied from."""
        if not hasattr(self._own, "run"):
            self._own.run = DeviceRun(self._session, self._model, self._draws), self.empty(self.muons)
        run: tuple[DeviceRun, Muons] = self._own.run
        return run


def _no_room(n: int) -> str:
    return f"{n} muons do not fit in the GPU's memory: take them in several times, with first="
