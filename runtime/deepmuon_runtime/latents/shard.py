"""A run of muons cut into parts that separate machines can make."""

from __future__ import annotations

import re
from dataclasses import dataclass

from deepmuon_runtime.errors import RefusedError

__all__ = ["WHOLE_RUN", "Shard"]


@dataclass(frozen=True)
class Shard:
    """Part `number` of the `of` parts of a run, counted from 1; as text "1/4".

    Parameters
    ----------
    number, of
        Which part, and how many there are.

    Raises
    ------
    RefusedError
        If there is no such part.

    Examples
    --------
    >>> [Shard(i, 3).numbers(10) for i in (1, 2, 3)]
    [range(0, 3), range(3, 6), range(6, 10)]
    """

    number: int
    of: int

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not 1 <= self.number <= self.of:
            raise RefusedError(f"there is no shard {self}: shard i/k has i from 1 to k")

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Read "i/k".

        Raises
        ------
        RefusedError
            If it is none of 1/k to k/k.
        """
        match = re.fullmatch(r"([0-9]{1,18})/([0-9]{1,18})", text)
        if match is None:
            raise RefusedError(f"{text!r} is no shard: write for instance 1/4, the first of four")
        return cls(int(match[1]), int(match[2]))

    def numbers(self, total: int) -> range:
        """Return which muons of a run of `total` belong here: floor(total (i-1) / k) to floor(total i / k)."""
        return range(total * (self.number - 1) // self.of, total * self.number // self.of)

    def __str__(self) -> str:
        """Return "i/k"."""
        return f"{self.number}/{self.of}"


WHOLE_RUN = Shard(1, 1)
"""The only part of a run that is not cut."""
