"""Muons of which some are rejected, and made again.

Draw k has attempts 0, 1, 2, ..., each with random numbers of its own, and gives the first muons that are taken of them.
So a muon needs no other draw, and is the same whatever else is made with it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import Muons
from deepmuon_runtime.sampling.drawing import Drawing

__all__ = ["Attempts"]

FEWEST = 16  # muons of a unit
OF_RARE = 8  # a unit of rare muons takes as long as so many pieces of common ones


class Attempts:
    """Makes muons in units of consecutive draws, always the whole unit: each is then made in the same way always.

    Parameters
    ----------
    drawing
        What is drawn.
    taken
        The share of muons that are not rejected, about: where few are, a unit is small.
    piece
        The muons of a unit where most are taken, in whole blocks.

    Attributes
    ----------
    muons : int
        Of a unit.
    """

    def __init__(self, drawing: Drawing, taken: float, piece: int) -> None:
        self._drawing = drawing
        self._arrays = drawing.maker.arrays
        self._block = drawing.maker.block_draws
        self._per_draw = drawing.maker.model.muons_per_draw
        self._draws = piece // self._per_draw
        wanted = max(FEWEST, OF_RARE * taken * piece)
        while self._draws > 1 and self._draws * self._per_draw > wanted:
            self._draws //= 2
        self.muons = self._draws * self._per_draw

    def fill(self, muons: Muons, seed: int, number: int, skipped: int, stopped: Callable[[], object]) -> None:
        """Make the muons of a unit, leave out the first, and keep as many as `muons` holds.

        Parameters
        ----------
        muons
            What is to be filled.
        seed
            0 to 2^64 - 1.
        number, skipped
            Which unit, and how many are left out.
        stopped
            Called now and then; it may raise.
        """
        if len(muons) == self.muons:
            self._fill(muons, seed, number, stopped)
            return
        made = self._drawing.empty(self.muons)
        self._fill(made, seed, number, stopped)
        for name, column in made.columns.items():
            muons.columns[name][:] = column[skipped : skipped + len(muons)]

    def _fill(self, made: Muons, seed: int, number: int, stopped: Callable[[], object]) -> None:
        """Make all muons of a unit."""
        have = self._arrays.zeros(self._draws, np.int64)  # muons that each draw has
        first = number * self._draws
        for start in range(0, self._draws, self._block):
            stopped()
            places = self._arrays.arange(start, min(start + self._block, self._draws), dtype=np.int64)
            draws = range(first + start, first + start + len(places))
            if self._per_draw == 1:  # made where they shall be: what is rejected gives way to a later attempt
                part = slice(start, start + len(places))
                have[part] = self._drawing.first(made[part], seed, draws)
            else:
                tried = self._drawing.empty(len(draws) * self._per_draw)
                self._keep(made, have, places, tried, self._drawing.first(tried, seed, draws))
        attempt, together = 1, 1
        wanting = np.flatnonzero(have < self._per_draw)
        while len(wanting):
            for start in range(0, len(wanting), self._block // together):
                stopped()
                places = wanting[start : start + self._block // together]
                attempts = np.tile(self._arrays.arange(attempt, attempt + together, dtype=np.int64), len(places))
                tried = self._drawing.empty(len(attempts) * self._per_draw)
                taken = self._drawing.again(tried, seed, attempts, np.repeat(first + places, together))
                self._keep(made, have, places, tried, taken)
            wanting = wanting[have[wanting] < self._per_draw]
            attempt += together
            together = min(2 * together, max(1, self._block // max(1, len(wanting))))

    def _keep(
        self,
        made: Muons,
        have: NDArray[np.int64],
        places: NDArray[np.int64],
        tried: Muons,
        taken: NDArray[np.bool_],
    ) -> None:
        """Keep the muons that are taken, as many as their draw wants.

        Parameters
        ----------
        made, have
            The unit's muons, and how many each of its draws has.
        places
            Which of its draws were made.
        tried, taken
            What was made of them, one or more attempts of each in a row, and which of these are taken.
        """
        of_each = taken.reshape(len(places), -1)
        total = np.cumsum(taken).reshape(of_each.shape)  # in one go: sums of each row take long where rows are short
        rank = total + (have[places] - total[:, 0] + of_each[:, 0])[:, None]  # from 1
        fits = np.flatnonzero(of_each & (rank <= self._per_draw))
        wanted = (places[:, None] * self._per_draw + rank - 1).ravel()[fits]
        have[places] = np.minimum(rank[:, -1], self._per_draw)
        for name, column in tried.columns.items():
            made.columns[name][wanted] = column[fits]
