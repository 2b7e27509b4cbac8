"""Running a model again and again on the same memory."""

from __future__ import annotations

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from deepmuon_runtime.model.contract import INPUT, OUTPUTS

__all__ = ["BoundRun"]


class BoundRun:
    """The input and outputs of a model in memory that stays from run to run (ONNX Runtime's IO binding).

    On the CPU the model reads and writes the arrays themselves. On CUDA it works in the device's memory: each run
    copies the latents there and the muons back, and nothing else. One thread may use it at a time; several
    may have one each of the same session.

    Parameters
    ----------
    session
        A model that keeps the contract.
    device
        Where the session runs, "cpu" or "cuda".
    draws, latent_size, muons
        Rows and columns of the latents, and how many muons the model makes of them.

    Attributes
    ----------
    latent : float32 [draws, latent_size]
        What the next run starts from; for the caller to fill.
    """

    def __init__(
        self, session: onnxruntime.InferenceSession, device: str, draws: int, latent_size: int, muons: int
    ) -> None:
        self.latent = np.zeros((draws, latent_size), np.float32)
        self._session = session
        self._arrays = (np.zeros(muons, np.float32), np.zeros((muons, 3), np.float32), np.zeros(muons, np.int8))
        self._input, *self._outputs = (
            onnxruntime.OrtValue.ortvalue_from_numpy(array, device) for array in (self.latent, *self._arrays)
        )
        self._binding = session.io_binding()
        self._binding.bind_ortvalue_input(INPUT, self._input)
        for name, output in zip(OUTPUTS, self._outputs, strict=True):
            self._binding.bind_ortvalue_output(name, output)
        self._is_shared = device == "cpu"  # then ONNX Runtime works in the arrays themselves

    def __call__(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]:
        """Run the model on `latent`.

        Returns
        -------
        Kinetic energy [muons], direction [muons, 3] and charge [muons], good until the next run.

        Raises
        ------
        Exception
            Of ONNX Runtime's own classes, if the model fails or gives another number of muons.
        """
        if not self._is_shared:
            self._input.update_inplace(self.latent)
        self._session.run_with_iobinding(self._binding)
        if self._is_shared:
            return self._arrays
        energy, direction, charge = (output.numpy() for output in self._outputs)
        return energy, direction, charge
