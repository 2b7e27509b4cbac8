"""A model's runs in a GPU's memory, from its random numbers to columns of muons."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from deepmuon_runtime.cuda.kernels import FILL_LATENTS, KERNELS, TAKE_MUONS, THREADS, blocks
from deepmuon_runtime.model.contract import INPUT, OUTPUTS
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import squared_length_tolerance

if TYPE_CHECKING:
    import onnxruntime

    from deepmuon_runtime.model.metadata import Model

__all__ = ["DeviceRun"]

NONE_IS_BAD = 2**64 - 1
MEMORY = "cuda"  # where ONNX Runtime finds arrays by their addresses


class DeviceRun:
    """The input and outputs of a model in a GPU's memory, for blocks of draws of one size.

    One thread may use it at a time. CuPy and ONNX Runtime work on streams of their own, so each waits for the other.

    Parameters
    ----------
    session
        A model that keeps the contract, on CUDA.
    model
        What it says of itself.
    draws
        How many draws a block has.
    """

    def __init__(self, session: onnxruntime.InferenceSession, model: Model, draws: int) -> None:
        import cupy

        self._cupy = cupy
        self._session = session
        self._model = model
        n = draws * model.muons_per_draw
        self._latent = cupy.empty((draws, model.latent_size), np.float32)
        self._outputs = (cupy.empty(n, np.float32), cupy.empty((n, 3), np.float32), cupy.empty(n, np.int8))
        self._first_bad = cupy.empty(1, np.uint64)
        self._binding = session.io_binding()
        self._bind(self._binding.bind_input, INPUT, self._latent)
        for name, output in zip(OUTPUTS, self._outputs, strict=True):
            self._bind(self._binding.bind_output, name, output)
        module = cupy.RawModule(code=KERNELS)
        self._fill_latents, self._take_muons = module.get_function(FILL_LATENTS), module.get_function(TAKE_MUONS)

    @staticmethod
    def _bind(bind: Any, name: str, array: Any) -> None:
        bind(name, MEMORY, 0, array.dtype.type, array.shape, array.data.ptr)

    def fill(self, muons: Muons, seed: int, stream: int, block: int, skipped: int) -> int | None:
        """Fill columns in the GPU's memory with muons of one block.

        Parameters
        ----------
        muons
            To be filled, not more than the block has after those that are skipped.
        seed, stream
            0 to 2^64 - 1.
        block
            Number of the block.
        skipped
            How many of its muons are left out, at its beginning.

        Returns
        -------
        Position among the muons of the first that `find_unphysical` finds fault with, or None.

        Raises
        ------
        Exception
            Of ONNX Runtime's and CuPy's own classes, if one fails or the model gives another number of muons.
        """
        size = self._latent.size
        first = np.uint64(block * size)
        self._launch(
            self._fill_latents,
            -(-size // 8) + 1,  # counters, one more where the first is cut
            np.uint64(seed),
            np.uint64(stream),
            first,
            np.uint64(size),
            self._latent,
        )
        self._cupy.cuda.get_current_stream().synchronize()
        self._session.run_with_iobinding(self._binding)
        self._first_bad.fill(NONE_IS_BAD)
        self._launch(
            self._take_muons,
            len(muons),
            np.uint64(skipped),
            np.uint64(len(muons)),
            *self._outputs,
            np.float32(self._model.energy_min_gev),
            np.float32(self._model.energy_max_gev),
            squared_length_tolerance(),
            muons.kinetic_energy,
            muons.u,
            muons.v,
            muons.w,
            muons.pdg_id,
            self._first_bad,
        )
        first_bad = int(self._first_bad.get()[0])
        return None if first_bad == NONE_IS_BAD else first_bad

    @staticmethod
    def _launch(kernel: Any, threads: int, *arguments: Any) -> None:
        kernel((blocks(threads),), (THREADS,), arguments)
