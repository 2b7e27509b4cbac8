"""Muons as they are drawn, and which of them are taken."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.cuts import Cuts
from deepmuon_runtime.latents.philox import FOR_POSITIONS
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.sampling.energy_cut import EnergyCut
from deepmuon_runtime.sampling.maker import Maker
from deepmuon_runtime.targets.target import Target

__all__ = ["NUMBERS_OF_PLACE", "Drawing"]

NUMBERS_OF_PLACE = 3
"""Numbers that put a muon on a target."""


class Drawing:
    """Draws of a model, put on a target: on the processor, or on a GPU.

    Parameters
    ----------
    maker
        What makes them, and all arrays.
    cuts, target
        What is asked.
    energy
        Where it is given, all muons are of its energies.
    """

    def __init__(self, maker: Maker, cuts: Cuts, target: Target | None, energy: EnergyCut | None) -> None:
        self.maker, self.cuts, self.target, self.energy = maker, cuts, target, energy

    def empty(self, n: int) -> Muons:
        """Return n muons whose columns are yet to be filled, with places where there is a target."""
        return self.maker.empty(n, has_place=self.target is not None)

    def first(self, muons: Muons, seed: int, draws: range, skipped: int = 0) -> NDArray[np.bool_]:
        """Make the first attempt of consecutive draws, at most those of a block.

        Parameters
        ----------
        muons
            What is to be filled; of a whole block, fewer may be kept.
        seed
            0 to 2^64 - 1.
        draws
            Which.
        skipped
            How many of the first muons are left out.

        Returns
        -------
        Which are taken: bool [n].
        """
        maker = self.maker
        latent = maker.latents(len(draws))
        maker.fill_latents(latent, seed, draws.start)
        if self.energy is not None:
            self.energy.squeeze(latent)
        maker.run(latent, muons, skipped)
        first = draws.start * maker.model.muons_per_draw + skipped
        numbers = None
        if self.target is not None:
            numbers = maker.arrays.empty((len(muons), NUMBERS_OF_PLACE), np.float32)
            maker.fill_latents(numbers, seed, first, FOR_POSITIONS)
        return self._taken(muons, first, numbers)

    def again(
        self, muons: Muons, seed: int, attempts: NDArray[np.int64], draws: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Make later attempts of any draws, at most as many as a block has.

        Parameters
        ----------
        muons
            What is to be filled.
        seed
            0 to 2^64 - 1.
        attempts, draws : int64 [draws]
            Which; the draws in order.

        Returns
        -------
        Which are taken: bool [n].
        """
        maker, model = self.maker, self.maker.model
        size = model.latent_size
        places = 0 if self.target is None else NUMBERS_OF_PLACE * model.muons_per_draw
        numbers = maker.numbers_again(seed, attempts, draws, size + places)
        latent = np.ascontiguousarray(numbers[:, :size], like=numbers)
        if self.energy is not None:
            self.energy.squeeze(latent)
        maker.run(latent, muons)
        of_places = numbers[:, size:].reshape(-1, NUMBERS_OF_PLACE) if places else None
        return self._taken(muons, int(draws[0]) * model.muons_per_draw, of_places)

    def _taken(self, muons: Muons, first: int, numbers: NDArray[np.float32] | None) -> NDArray[np.bool_]:
        """Put muons on the target, and tell which are taken."""
        if self.energy is not None:
            self.energy.clamp(muons)
        self.maker.check(muons, first)
        taken = self.cuts.keeps(muons)
        if self.target is not None and numbers is not None:
            hits, *place = self.target.enters(muons.u, muons.v, muons.w, numbers)
            taken &= hits
            for name, found in zip(("x", "y", "z"), place, strict=True):
                muons.columns[name][:] = found
        return taken
