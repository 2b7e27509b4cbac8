"""What makes the muons of a model from latents, in one memory: the computer's, or a GPU's."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import NDArray

from deepmuon_runtime.latents.philox import FOR_LATENTS
from deepmuon_runtime.model.metadata import Model
from deepmuon_runtime.muons import Muons

__all__ = ["Maker"]


class Maker(Protocol):
    """Random numbers of a model, and its muons from them, as arrays of numpy or of CuPy.

    Both know numpy's functions, which call CuPy's where the arrays are CuPy's (NEP 13 and 18). So what is done with
    the arrays is written once.

    Attributes
    ----------
    model : Model
        What the model says of itself.
    block_draws : int
        How many draws a run of the network makes at most.
    """

    model: Model
    block_draws: int

    @property
    def block_muons(self) -> int:
        """The muons of a block."""

    @property
    def arrays(self) -> Any:
        """The module that makes arrays: numpy, or CuPy."""

    def empty(self, n: int, *, has_place: bool) -> Muons:
        """Return n muons whose columns are yet to be filled."""

    def latents(self, draws: int) -> NDArray[Any]:
        """Return memory for the latents of some draws, float32 [draws, latent_size], good until the next run."""

    def fill_latents(self, latent: NDArray[Any], seed: int, first: int, purpose: int = FOR_LATENTS) -> None:
        """Fill an array with the latents of consecutive draws; the parameters are those of `philox.fill_latents`."""

    def numbers_again(self, seed: int, attempts: NDArray[Any], draws: NDArray[Any], size: int) -> NDArray[Any]:
        """Return the numbers of some draws at later attempts; the parameters are those of `again.numbers_again`."""

    def run(self, latent: NDArray[Any], muons: Muons, skipped: int = 0) -> None:
        """Make the muons of some draws, at most those of a block, and keep as many as asked for.

        Parameters
        ----------
        latent : float32 [draws, latent_size]
            What `latents` gave, or other memory.
        muons
            What is to be filled.
        skipped
            How many of the first muons are left out.
        """

    def check(self, muons: Muons, first: int) -> None:
        """Raise FailedError if one of these muons, from number `first` on, can't be one."""
