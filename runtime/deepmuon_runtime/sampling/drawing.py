"""Muons as they are drawn, and which of them are taken."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.cuts import Cuts
from deepmuon_runtime.latents.again import numbers_again
from deepmuon_runtime.latents.philox import FOR_POSITIONS, fill_latents
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.sampling.energy_cut import EnergyCut
from deepmuon_runtime.sampling.source import Source
from deepmuon_runtime.targets.target import Target

__all__ = ["NUMBERS_OF_PLACE", "Drawing"]

NUMBERS_OF_PLACE = 3
"""Numbers that put a muon on a target."""


class Drawing:
    """Draws of a source, put on a target.

    Parameters
    ----------
    source, cuts, target
        What is asked.
    energy
        Where it is given, all muons are of its energies.
    """

    def __init__(self, source: Source, cuts: Cuts, target: Target | None, energy: EnergyCut | None) -> None:
        self.source, self.cuts, self.target, self.energy = source, cuts, target, energy

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
        source, model = self.source, self.source.model
        is_block = len(draws) == source.block_draws
        latent = source.block_latents if is_block else np.empty((len(draws), model.latent_size), np.float32)
        fill_latents(latent, seed, draws.start, model.stream)
        if self.energy is not None:
            self.energy.squeeze(latent)
        if is_block:
            source.run_block(muons, skipped)
        else:
            source.run(latent, muons)
        first = draws.start * model.muons_per_draw + skipped
        numbers = None
        if self.target is not None:
            numbers = np.empty((len(muons), NUMBERS_OF_PLACE), np.float32)
            fill_latents(numbers, seed, first, model.stream, purpose=FOR_POSITIONS)
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
        model = self.source.model
        size = model.latent_size
        places = 0 if self.target is None else NUMBERS_OF_PLACE * model.muons_per_draw
        numbers = numbers_again(seed, model.stream, attempts, draws, size + places)
        latent = np.ascontiguousarray(numbers[:, :size])
        if self.energy is not None:
            self.energy.squeeze(latent)
        self.source.run(latent, muons)
        of_places = numbers[:, size:].reshape(-1, NUMBERS_OF_PLACE) if places else None
        return self._taken(muons, int(draws[0]) * model.muons_per_draw, of_places)

    def _taken(self, muons: Muons, first: int, numbers: NDArray[np.float32] | None) -> NDArray[np.bool_]:
        """Put muons on the target, and tell which are taken."""
        if self.energy is not None:
            self.energy.clamp(muons)
        self.source.check(muons, first)
        taken = self.cuts.keeps(muons)
        if self.target is not None and numbers is not None:
            hits, *place = self.target.enters(muons.u, muons.v, muons.w, numbers)
            taken &= hits
            for name, found in zip(("x", "y", "z"), place, strict=True):
                muons.columns[name][:] = found
        return taken
