"""Pictures of muons: energy spectrum and zenith distribution. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime.views.spectra import ENERGY_EDGES, ZENITH_EDGES, Spectra

__all__ = ["draw_spectra"]

STYLE: dict[Any, Any] = {
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "font.size": 10,
    "grid.color": "#e6e6e6",
    "legend.frameon": False,
}

Float = NDArray[np.float64]


def draw_spectra(spectra: Sequence[Spectra]) -> Figure:
    """Draw the muons of several files over each other.

    The curves are rates per m2 of horizontal plane where all files know theirs, else shares of the muons.
    """
    per_rate = all(each.rate is not None for each in spectra)
    with rc_context(STYLE):
        figure = Figure(figsize=(10.0, 4.2), dpi=150, layout="constrained")
        energy, zenith = figure.subplots(1, 2)
        for each in spectra:
            muon = (each.rate or 1.0) / each.count if per_rate else 1 / each.count
            label = f"{each.name}: {each.count:,} muons at {each.depth_m:g} m"
            _stairs(energy, each.by_energy * muon / np.diff(np.log(ENERGY_EDGES)), ENERGY_EDGES, label)
            _stairs(zenith, each.by_zenith * muon / np.diff(ZENITH_EDGES), ZENITH_EDGES, label)
        what = "muons / (m² s)" if per_rate else "share of the muons"
        energy.set(xscale="log", yscale="log", xlabel="kinetic energy / GeV", ylabel=f"{what} per unit of ln E")
        zenith.set(xlim=(0, 90), xlabel="zenith angle / degrees", ylabel=f"{what} per degree")
        zenith.set_ylim(bottom=0)
        zenith.legend()
    return figure


def _stairs(axes: Axes, values: Float, edges: Float, label: str) -> None:
    """Draw a histogram from its first muon to its last."""
    filled = np.flatnonzero(values)
    if len(filled):
        kept = slice(filled[0], filled[-1] + 1)
        axes.stairs(
            np.where(values > 0, values, np.nan)[kept], edges[filled[0] : filled[-1] + 2], baseline=None, label=label
        )
