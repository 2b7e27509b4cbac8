"""A loaded model that makes draws: whole blocks of them, or any."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import FailedError, RefusedError, first_line
from deepmuon_runtime.freed_memory import keep_freed_memory
from deepmuon_runtime.latents.again import numbers_again
from deepmuon_runtime.latents.philox import FOR_LATENTS, fill_latents
from deepmuon_runtime.model.metadata import LATENTS_PER_MUON, Model
from deepmuon_runtime.muons import MU_PLUS, Muons
from deepmuon_runtime.physical import check_physical

if TYPE_CHECKING:
    import onnxruntime

    from deepmuon_runtime.cuda.maker import DeviceMaker
    from deepmuon_runtime.model.bound_run import BoundRun

__all__ = ["TRIED", "Source", "block_draws"]

# Muons of one run of the network, about. What a wide network works on shall stay in a CPU's cache. Tables need little;
# what they cost is that threads take turns at Python's lock, block by block. A GPU wants much at once.
BLOCK = {"cpu": 1 << 14, "cuda": 1 << 18}
BLOCK_OF_SINGLE_MUONS = {**BLOCK, "cpu": 1 << 16}
TRIED = 5
"""Values of the latents that are tried before the first muons: the ends, the middle, and two between."""

Outputs = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]  # energy, direction, charge


class Source:
    """A model of one depth and surface on a device, whose muons come into the computer's memory: a `Maker`.

    Parameters
    ----------
    session, model, device
        As `load_model` gives them.

    Attributes
    ----------
    block_draws : int
        How many draws a run of the network makes at most.
    """

    def __init__(self, session: onnxruntime.InferenceSession, model: Model, device: str) -> None:
        self.model = model
        self.device = device
        self.block_draws = block_draws(model, (BLOCK_OF_SINGLE_MUONS if model.muons_per_draw == 1 else BLOCK)[device])
        self._session = session
        self._own = threading.local()  # each thread's memory for its runs
        keep_freed_memory()

    @cached_property
    def on_device(self) -> DeviceMaker | None:
        """What makes this model's muons in a GPU's memory alone, where it runs on one and CuPy is installed."""
        if self.device != "cuda":
            return None
        from deepmuon_runtime.cuda.maker import INSTALL, DeviceMaker
        from deepmuon_runtime.model.device import has_cupy

        if not has_cupy():
            warnings.warn(f"random numbers for the GPU come from the processor, which is slow: {INSTALL}", stacklevel=6)
            return None
        return DeviceMaker(self._session, self.model)

    @property
    def block_muons(self) -> int:
        """The muons of a block."""
        return self.block_draws * self.model.muons_per_draw

    @property
    def arrays(self) -> Any:
        """Numpy."""
        return np

    def empty(self, n: int, *, has_place: bool) -> Muons:
        """Return n muons whose columns are yet to be filled."""
        return Muons.empty(n, has_place=has_place)

    def latents(self, draws: int) -> NDArray[np.float32]:
        """Return memory for the latents of some draws: of a block the thread's own, else new."""
        is_block = draws == self.block_draws
        return self._thread_run().latent if is_block else np.empty((draws, self.model.latent_size), np.float32)

    def fill_latents(self, latent: NDArray[np.float32], seed: int, first: int, purpose: int = FOR_LATENTS) -> None:
        """Fill an array with the latents of consecutive draws."""
        fill_latents(latent, seed, first, self.model.stream, purpose=purpose)

    def numbers_again(
        self, seed: int, attempts: NDArray[np.int64], draws: NDArray[np.int64], size: int
    ) -> NDArray[np.float32]:
        """Return the numbers of some draws at later attempts."""
        return numbers_again(seed, self.model.stream, attempts, draws, size)

    def run(self, latent: NDArray[np.float32], muons: Muons, skipped: int = 0) -> None:
        """Make the muons of some draws, and keep as many as asked for; raise FailedError if the model fails."""
        if len(latent) == self.block_draws:
            run = self._thread_run()
            if latent is not run.latent:
                run.latent[:] = latent
            self._run(run, skipped, muons)
        else:
            self._run(lambda: self._outputs(latent), skipped, muons)

    def check(self, muons: Muons, first: int) -> None:
        """Raise FailedError if one of these muons, from number `first` on, can't be one."""
        check_physical(muons, self.model.energy_min_gev, self.model.energy_max_gev, first)

    def try_out(self, draws: int = TRIED, options: onnxruntime.RunOptions | None = None) -> None:
        """Raise RefusedError if the model fails at the ends or in the middle of its latents, in so many draws."""
        values = np.resize(np.linspace(-1, 1, TRIED, dtype=np.float32), draws)
        latent = np.repeat(values[:, None], self.model.latent_size, axis=1)
        muons = Muons.empty(len(latent) * self.model.muons_per_draw)
        try:
            self._run(lambda: self._outputs(latent, options), 0, muons)
            self.check(muons, 0)
        except FailedError as error:
            raise RefusedError(f"{self.model.name} breaks the contract in a trial: {error}") from error

    def _outputs(self, latent: NDArray[np.float32], options: onnxruntime.RunOptions | None = None) -> Outputs:
        from deepmuon_runtime.model.contract import INPUT, OUTPUTS

        energy, direction, charge = self._session.run(OUTPUTS, {INPUT: latent}, options)
        expected = len(latent) * self.model.muons_per_draw
        if not len(energy) == len(direction) == len(charge) == expected:
            raise ValueError(
                f"it gave {len(energy)} energies, {len(direction)} directions and {len(charge)} charges, "
                f"and should give {expected} each"
            )
        return energy, direction, charge

    def _thread_run(self) -> BoundRun:
        """Return the run of blocks that belongs to this thread."""
        from deepmuon_runtime.model.bound_run import BoundRun

        if not hasattr(self._own, "run"):
            self._own.run = BoundRun(
                self._session, self.device, self.block_draws, self.model.latent_size, self.block_muons
            )
        run: BoundRun = self._own.run
        return run

    def _run(self, run: Callable[[], Outputs], skipped: int, muons: Muons) -> None:
        """Run the model, leave out the first muons, and keep as many as asked for."""
        try:
            energy, direction, charge = run()
        except Exception as error:  # ONNX Runtime's own classes have no common base
            from deepmuon_runtime.model.trial import memory_asked

            reason = memory_asked(error) or first_line(error)
            raise FailedError(f"the model {self.model.name} failed: {reason}") from error
        kept = slice(skipped, skipped + len(muons))
        muons.kinetic_energy[:] = energy[kept]
        for axis, column in enumerate((muons.u, muons.v, muons.w)):
            column[:] = direction[kept, axis]
        np.multiply(charge[kept], np.int8(MU_PLUS), out=muons.pdg_id)


def block_draws(model: Model, muons: int) -> int:
    """Return how many draws make a block of about so many muons; of large ones, which lie in memory, as few as one."""
    size = max(model.muons_per_draw, model.latent_size // LATENTS_PER_MUON)
    # Multiples of 8 draws where they fit: a block then begins with a whole step of the random number generator.
    step = 8 if 8 * size <= muons else 1
    return -(-muons // (step * size)) * step
