"""What smoothing changes in CRY's held-out muons, and what it keeps.

``python -m studies.pictures.smoothing cry_sea_level.h5`` draws docs/images/smoothing.png.
"""

from __future__ import annotations

import sys

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime.muons import Muons
from deepmuon_training.data.cry import HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.data.cry_cells import COS_ZENITH_EDGES, ENERGY_CELL
from deepmuon_training.data.smoothing import StepSmoother
from deepmuon_training.reports.pictures import STYLE
from studies.shared.processes import REPOSITORY

__all__ = ["draw_smoothing"]

PICTURE = REPOSITORY / "docs" / "images" / "smoothing.png"

_ENERGY_CELLS = ENERGY_CELL * np.arange(-8, 14)
_FINE = 8  # bins to a cell
_SLICE = (0.4, 0.6)  # of log10 energy, whose zenith angles are shown

Float = NDArray[np.float64]


def main(cry: str) -> None:
    """Smooth the muons that never trained by maps of the others, and draw them."""
    smooth = StepSmoother(read_cry(cry, slice(-HELD_OUT_CRY_MUONS)).muons)
    raw = read_cry(cry, slice(-HELD_OUT_CRY_MUONS, None)).muons
    draw_smoothing(raw, smooth(raw)).savefig(PICTURE, dpi=110)


def draw_smoothing(raw: Muons, smoothed: Muons) -> Figure:
    """Draw energy spectrum and zenith distribution before and after, in fine bins and in CRY's cells.

    Parameters
    ----------
    raw, smoothed
        The same muons, as CRY made them and after `deepmuon_training.data.smoothing.StepSmoother`.
    """
    near = (raw.kinetic_energy > 10 ** _SLICE[0]) & (raw.kinetic_energy < 10 ** _SLICE[1])
    near_smoothed = (smoothed.kinetic_energy > 10 ** _SLICE[0]) & (smoothed.kinetic_energy < 10 ** _SLICE[1])
    columns = (
        (np.log10(raw.kinetic_energy), np.log10(smoothed.kinetic_energy), _ENERGY_CELLS),
        (raw.cos_zenith[near], smoothed.cos_zenith[near_smoothed], COS_ZENITH_EDGES),
    )
    with rc_context(STYLE):
        figure = Figure(figsize=(10.0, 5.5), dpi=120, layout="constrained")
        axes = figure.subplots(2, 2, height_ratios=[5, 2], sharex="col")
        for (before, after, cells), upper, lower in zip(columns, *axes, strict=True):
            _draw_column(upper, lower, before.astype(np.float64), after.astype(np.float64), cells)
        axes[0, 0].set(yscale="log", ylabel="muons in a bin", title="kinetic energy")
        axes[0, 1].set(title=f"zenith, {10 ** _SLICE[0]:.1f} to {10 ** _SLICE[1]:.1f} GeV")
        axes[0, 1].legend()
        axes[1, 0].set(xlabel="log10(E / GeV)", ylabel="smoothed / raw")
        axes[1, 1].set(xlabel="cos zenith")
    return figure


def _draw_column(upper: Axes, lower: Axes, before: Float, after: Float, cells: Float) -> None:
    """Draw fine bins of both, and the ratio in fine bins and in whole cells underneath."""
    fine = np.interp(np.arange((len(cells) - 1) * _FINE + 1) / _FINE, np.arange(len(cells)), cells)
    for values, label, color in ((before, "CRY", "0.55"), (after, "smoothed", "#c1272d")):
        upper.stairs(np.histogram(values, fine)[0], fine, baseline=None, label=label, color=color)
    for edges, label, color in ((fine, "fine bins", "#c1272d"), (cells, "cells", "#1f4e9e")):
        counts = [np.histogram(values, edges)[0] for values in (before, after)]
        ratio = np.where(counts[0] >= 100, counts[1] / np.maximum(counts[0], 1), np.nan)
        lower.stairs(ratio, edges, baseline=None, label=label, color=color)
    lower.set(ylim=(0.65, 1.35))
    lower.legend(ncols=2, fontsize="small")


if __name__ == "__main__":
    main(sys.argv[1])
