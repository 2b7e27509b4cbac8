"""Tables of other programs to muons: the one place where named columns become them."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.data.foreign.columns import Columns
from deepmuon_training.data.foreign.particles import MUON_IDS, count_others
from deepmuon_training.data.foreign.table import Float, Place, Table

__all__ = ["ForeignMuons", "read_foreign"]


MOST_KINDS = 3  # of particles that are named


class ForeignMuons(NamedTuple):
    """The muons of a table.

    Parameters
    ----------
    muons : Muons
        Their pdg_id is 0 where no column has the charge.
    weights : float64 [n] or None
        Not negative; None where no column has them.
    others : Counter
        How many particles of which number were left out.
    """

    muons: Muons
    weights: Float | None
    others: Counter[str]

    @property
    def rows(self) -> int:
        """How many the table has."""
        return len(self.muons) + self.others.total()

    @property
    def left_out(self) -> list[str]:
        """What was left out, in words: a line, or none."""
        if not self.others:
            return []
        kinds = [f"{count:,} of {number}" for number, count in self.others.most_common(MOST_KINDS)]
        more = ", ..." * (len(self.others) > MOST_KINDS)
        return [f"{self.others.total():,} of {self.rows:,} rows left out, which are no muons: {', '.join(kinds)}{more}"]


def read_foreign(table: Table, columns: Columns, *, muons_only: bool = False) -> ForeignMuons:
    """Read the muons of a table, in pieces.

    Parameters
    ----------
    table
        The table, opened.
    columns
        What its columns mean.
    muons_only
        Whether particles that are no muons are left out, and not refused.

    Raises
    ------
    RefusedError
        If the file can't be read, or a row is no muon, or has a weight that can't be; or all are left out.
    """
    muons, weights, others = [], [], Counter[str]()
    for place, rows in table.rows(columns.wanted):
        kept = np.arange(len(rows))
        if muons_only and columns.id_kind is not None:
            ids = columns.column(columns.id_kind, rows)
            others += count_others(columns.id_kind, ids)
            kept = np.flatnonzero(np.isin(ids, MUON_IDS[columns.id_kind]))
        muons.append(columns.muons(rows[kept], _of(kept, place)))
        if columns.has_weight:
            weights.append(_weights(columns.column("weight", rows[kept]), _of(kept, place)))
    if not any(map(len, muons)):
        kinds = ", ".join(number for number, _ in others.most_common(MOST_KINDS))
        raise RefusedError(
            f"{table.path} has no muon: {columns.id_kind} is {kinds}{', ...' * (len(others) > MOST_KINDS)}"
        )
    return ForeignMuons(Muons.concatenate(muons), np.concatenate(weights) if weights else None, others)


def _of(kept: np.ndarray[tuple[int], np.dtype[np.int64]], place: Place) -> Place:
    return lambda index: place(int(kept[index]))


def _weights(weights: Float, place: Place) -> Float:
    bad = ~((weights >= 0) & np.isfinite(weights))
    if bad.any():
        row = int(np.argmax(bad))
        raise RefusedError(f"{place(row)}: the muon has a weight of {weights[row]:g}, which is negative or not finite")
    return weights
