"""A model's runs in a GPU's memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from deepmuon_runtime.model.contract import INPUT, OUTPUTS

if TYPE_CHECKING:
    import onnxruntime

    from deepmuon_runtime.model.metadata import Model

__all__ = ["DeviceRun"]

MEMORY = "cuda"  # where ONNX Runtime finds arrays by their addresses


class DeviceRun:
    """The input and outputs of a model in a GPU's memory, for any number of draws up to that of a block.

    One thread may use it at a time. CuPy and ONNX Runtime work on streams of their own, so each waits for the other.

    Parameters
    ----------
    session
        A model that keeps the contract, on CUDA.
    model
        What it says of itself.
    draws
        How many draws a block has.

    Attributes
    ----------
    latent : float32 [draws, latent_size]
        What the next run starts from; for the caller to fill.
    """

    def __init__(self, session: onnxruntime.InferenceSession, model: Model, draws: int) -> None:
        import cupy

        self._cupy = cupy
        self._session = session
        self._per_draw = model.muons_per_draw
        n = draws * model.muons_per_draw
        self.latent = cupy.empty((draws, model.latent_size), np.float32)
        self._outputs = (cupy.empty(n, np.float32), cupy.empty((n, 3), np.float32), cupy.empty(n, np.int8))
        self._binding = session.io_binding()
        self._bound = 0  # draws

    def __call__(self, draws: int) -> tuple[Any, Any, Any]:
        """Run the model on the first rows of `latent`.

        Returns
        -------
        Kinetic energy [n], direction [n, 3] and charge [n] of at least the muons of so many draws, good until the next
        run.

        Raises
        ------
        Exception
            Of ONNX Runtime's and CuPy's own classes, if one fails or the model gives another number of muons.
        """
        if draws != self._bound:
            self._bind(self._binding.bind_input, INPUT, self.latent[:draws])
            for name, output in zip(OUTPUTS, self._outputs, strict=True):
                self._bind(self._binding.bind_output, name, output[: draws * self._per_draw])
            self._bound = draws
        self._cupy.cuda.get_current_stream().synchronize()
        self._session.run_with_iobinding(self._binding)
        return self._outputs

    @staticmethod
    def _bind(bind: Any, name: str, array: Any) -> None:
        bind(name, MEMORY, 0, array.dtype.type, array.shape, array.data.ptr)
