"""Muons of a model, made in a GPU's memory from the random numbers on."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from deepmuon_runtime.cuda.arrivals import fill_times
from deepmuon_runtime.cuda.device_run import DeviceRun
from deepmuon_runtime.cuda.kernels import Kernels
from deepmuon_runtime.cuda.memory import empty
from deepmuon_runtime.errors import FailedError, first_line
from deepmuon_runtime.latents.arrivals import Arrivals
from deepmuon_runtime.latents.philox import FOR_LATENTS, latents
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import check_physical
from deepmuon_runtime.targets.target import Target

if TYPE_CHECKING:
    import onnxruntime

    from deepmuon_runtime.model.metadata import Model

__all__ = ["INSTALL", "DeviceMaker"]

INSTALL = "pip install 'deepmuon-runtime[cuda]'"
"""What brings CuPy."""

BLOCK = 1 << 22
"""Muons of one run of the network, about: a GPU wants so many at once."""

TRIED = 256  # muons on a target, to see whether it takes CuPy's arrays


class DeviceMaker:
    """Muons of a model on CUDA, of which nothing comes from the processor: a `sampling.maker.Maker`.

    They are those of the processor to float32 rounding, whatever the blocks.

    Parameters
    ----------
    session, model
        As `load_model` gives them, on CUDA.

    Attributes
    ----------
    block_draws : int
        How many draws a run of the network makes at most.
    """

    def __init__(self, session: onnxruntime.InferenceSession, model: Model) -> None:
        self.model = model
        self.block_draws = -(-BLOCK // model.muons_per_draw)
        self._session = session
        self._own = threading.local()  # each thread's memory for its runs

    @property
    def block_muons(self) -> int:
        """The muons of a block."""
        return self.block_draws * self.model.muons_per_draw

    @property
    def arrays(self) -> Any:
        """CuPy."""
        import cupy

        return cupy

    def empty(self, n: int, *, has_place: bool) -> Muons:
        """Return n muons in the GPU's memory, or raise RefusedError."""
        return empty(n, has_place=has_place)

    def latents(self, draws: int) -> Any:
        """Return the thread's own memory for the latents of some draws."""
        return self._run.latent[:draws]

    def fill_latents(self, latent: Any, seed: int, first: int, purpose: int = FOR_LATENTS) -> None:
        """Fill an array with the latents of consecutive draws."""
        self._kernels.fill_latents(latent, seed, self.model.stream, purpose, first * latent.shape[1])

    def numbers_again(self, seed: int, attempts: Any, draws: Any, size: int) -> Any:
        """Return the numbers of some draws at later attempts."""
        numbers = self.arrays.empty((len(draws), size), np.float32)
        self._kernels.fill_again(numbers, seed, self.model.stream, attempts, draws)
        return numbers

    def run(self, latent: Any, muons: Muons, skipped: int = 0) -> None:
        """Make the muons of some draws, and keep as many as asked for; raise FailedError if the model fails."""
        try:
            run = self._run
            if latent.data.ptr != run.latent.data.ptr:
                run.latent[: len(latent)] = latent
            self._kernels.take_muons(run(len(latent)), skipped, muons)
        except Exception as error:  # of ONNX Runtime and CuPy, which have no common base
            raise self._failed(error) from error

    def check(self, muons: Muons, first: int) -> None:
        """Raise FailedError if one of these muons can't be one, in the words that there are for the processor's."""
        model = self.model
        bad = self._kernels.first_bad(muons, model.energy_min_gev, model.energy_max_gev)
        if bad is None:
            return
        muon = muons[bad : bad + 1]
        here = Muons(**{name: column.get() for name, column in muon.columns.items()})  # type: ignore[attr-defined]
        check_physical(here, model.energy_min_gev, model.energy_max_gev, first + bad)
        raise FailedError(f"the model gave a bad muon: number {first + bad}, of which the processor finds no fault")

    def fill(self, muons: Muons, make: Callable[[Muons], None]) -> None:
        """Make muons, in either memory.

        Parameters
        ----------
        muons
            What is to be filled: of CuPy's arrays, or of numpy's, to which they are copied.
        make
            Fills all columns but the times of its argument, which are CuPy's.

        Raises
        ------
        FailedError
            If CuPy fails, or what `make` raises.
        """
        with self._failures():
            if isinstance(muons.kinetic_energy, self.arrays.ndarray):
                make(muons)
            else:
                made = self.empty(len(muons), has_place=muons.x is not None)
                make(made)
                for name, column in made.columns.items():
                    column.get(out=muons.columns[name])  # type: ignore[attr-defined] # CuPy's

    def fill_times(self, times: Any, arrivals: Arrivals, numbers: range) -> None:
        """Say when muons come, in either memory; raise FailedError if CuPy fails.

        Parameters
        ----------
        times : float64 [n]
            What is to be filled: CuPy's, or numpy's, to which they are copied.
        arrivals, numbers
            Whose times, and which.
        """
        with self._failures():
            if isinstance(times, self.arrays.ndarray):
                fill_times(times, arrivals, numbers, self._kernels)
            else:
                made = self.arrays.empty(len(numbers), np.float64)
                fill_times(made, arrivals, numbers, self._kernels)
                made.get(out=times)

    def puts_on(self, target: Target) -> bool:
        """Tell whether a target's formulas take CuPy's arrays, by some muons; warn if they don't.

        DeepMuon's own do. A body of a user's own does if it calls numpy's functions on what it is given, and makes no
        arrays of numpy's.
        """
        numbers = latents(0, 0, TRIED, 6)
        direction = numbers[:, :3] / np.linalg.norm(numbers[:, :3], axis=1, keepdims=True)
        given = *direction[:, :2].T, -np.abs(direction[:, 2]), numbers[:, 3:]
        try:
            u, v, w, of_place = (self.arrays.asarray(part) for part in given)
            entries: tuple[Any, ...] = target.enters(u, v, w, of_place)
            found = [len(part.get()) for part in entries]
        except Exception as error:  # whatever a stranger's formulas raise
            reason = first_line(error)
        else:
            if found == [TRIED] * 4:
                return True
            reason = "it gives another number of them"
        warnings.warn(
            f"muons on the {target.name} come from the processor, which is slow: it does not take CuPy's arrays "
            f"({reason})",
            stacklevel=6,
        )
        return False

    @contextmanager
    def _failures(self) -> Iterator[None]:
        """Tell in one line what CuPy raises: memory that ran out, a library that is missing, errors of its own."""
        try:
            yield
        except Exception as error:  # CuPy's classes have no common base
            is_cupys = type(error).__module__.split(".")[0] in ("cupy", "cupy_backends")
            if is_cupys or isinstance(error, MemoryError | RuntimeError | ImportError):
                raise self._failed(error) from error
            raise

    def _failed(self, error: Exception) -> FailedError:
        return FailedError(f"the model {self.model.name} failed on the GPU: {first_line(error)}")

    @cached_property
    def _kernels(self) -> Kernels:
        return Kernels()

    @property
    def _run(self) -> DeviceRun:
        """The runs that belong to this thread."""
        if not hasattr(self._own, "run"):
            self._own.run = DeviceRun(self._session, self.model, self.block_draws)
        run: DeviceRun = self._own.run
        return run
