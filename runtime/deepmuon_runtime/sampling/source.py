"""A loaded model that makes draws: whole blocks of them, or any."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import FailedError, RefusedError, first_line
from deepmuon_runtime.model.metadata import LATENTS_PER_MUON, Model
from deepmuon_runtime.muons import MU_PLUS, Muons
from deepmuon_runtime.physical import check_physical

if TYPE_CHECKING:
    import onnxruntime

    from deepmuon_runtime.cuda.blocks import DeviceBlocks
    from deepmuon_runtime.model.bound_run import BoundRun

__all__ = ["TRIED", "Source"]

# Muons of one run of the network, about: what it works on stays in a CPU's cache; a GPU wants much at once.
BLOCK = {"cpu": 1 << 14, "cuda": 1 << 18}
TRIED = 5
"""Values of the latents that are tried before the first muons: the ends, the middle, and two between."""

Outputs = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]  # energy, direction, charge


class Source:
    """A model of one depth and surface on a device.

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
        self.block_draws = _block_draws(model, device)
        self._session = session
        self._own = threading.local()  # each thread's memory for its runs

    @cached_property
    def on_device(self) -> DeviceBlocks | None:
        """What makes this model's muons in a GPU's memory alone, where it runs on one and CuPy is installed."""
        if self.device != "cuda":
            return None
        from deepmuon_runtime.cuda.blocks import INSTALL, DeviceBlocks
        from deepmuon_runtime.model.device import has_cupy

        if not has_cupy():
            warnings.warn(f"random numbers for the GPU come from the processor, which is slow: {INSTALL}", stacklevel=6)
            return None
        return DeviceBlocks(self._session, self.model)

    @property
    def block_muons(self) -> int:
        """The muons of a block."""
        return self.block_draws * self.model.muons_per_draw

    @property
    def block_latents(self) -> NDArray[np.float32]:
        """The thread's own memory for the latents of a block, float32 [block_draws, latent_size]: to be filled."""
        return self._thread_run().latent

    def run_block(self, muons: Muons, skipped: int = 0) -> None:
        """Make the muons of a block from `block_latents`, leave out the first, and keep as many as `muons` holds."""
        self._run(self._thread_run(), skipped, muons)

    def run(self, latent: NDArray[np.float32], muons: Muons) -> None:
        """Make all muons of some draws, at most those of a block, from latents [draws, latent_size]."""
        if len(latent) == self.block_draws:
            self.block_latents[:] = latent
            self.run_block(muons)
        else:
            self._run(lambda: self._outputs(latent), 0, muons)

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


def _block_draws(model: Model, device: str) -> int:
    """Return how many draws make a block: of large ones, which each thread has in memory, as few as one."""
    size = max(model.muons_per_draw, model.latent_size // LATENTS_PER_MUON)
    # Multiples of 8 draws where they fit: a block then begins with a whole step of the random number generator.
    step = 8 if 8 * size <= BLOCK[device] else 1
    return -(-BLOCK[device] // (step * size)) * step
