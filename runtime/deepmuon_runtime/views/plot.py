"""Pictures of muons: energy spectrum and zenith distribution. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime.views.spectra import COS_ZENITH_EDGES, ENERGY_EDGES, Spectra

__all__ = ["draw_spectra", "place"]

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
    """Draw the muons of several files over each other, with bands of one standard deviation.

    The curves are rates per m2 of horizontal plane where all files know theirs, else shares of the muons: per unit of
    ln E, which is E dPhi/dE, and per unit of the cosine of the zenith angle.
    """
    per_rate = all(each.rate is not None for each in spectra)
    with rc_context(STYLE):
        figure = Figure(figsize=(10.0, 4.2 + 0.2 * len(spectra)), dpi=150, layout="constrained")
        energy, zenith = figure.subplots(1, 2)
        for each in spectra:
            muon = (each.rate or 1.0) / each.count if per_rate else 1 / each.count
            flux = f", flux {each.flux}" if each.flux else ""
            label = f"{each.name}: {each.count:,} muons {place(each.depth_m, each.medium)}{flux}"
            _stairs(energy, each.by_energy, muon / np.diff(np.log(ENERGY_EDGES)), ENERGY_EDGES, label)
            _stairs(zenith, each.by_cos_zenith, muon / np.diff(COS_ZENITH_EDGES), COS_ZENITH_EDGES, label)
        energy.set(xscale="log", yscale="log", xlabel="kinetic energy / GeV")
        zenith.set(xlim=(0, 1), xlabel="cosine of the zenith angle")
        zenith.set_ylim(bottom=0)
        if per_rate:
            energy.set_ylabel("$E$ dΦ/d$E$  /  m$^{-2}$ s$^{-1}$")
            zenith.set_ylabel("dΦ/d cos θ  /  m$^{-2}$ s$^{-1}$")
        else:
            energy.set_ylabel("share of the muons per unit of ln $E$")
            zenith.set_ylabel("share of the muons per unit of cos θ")
        figure.legend(*energy.get_legend_handles_labels(), loc="outside upper left")
    return figure


def place(depth_m: float, medium: str) -> str:
    """Return where a plane is, in words."""
    if depth_m == 0:
        return "at sea level"
    return f"under {depth_m:g} m of {'water' if medium == 'G4_WATER' else medium}"


def _stairs(axes: Axes, counts: NDArray[np.int64], scale: Float, edges: Float, label: str) -> None:
    """Draw a histogram from its first muon to its last, and its Poisson errors."""
    filled = np.flatnonzero(counts)
    if len(filled):
        kept = slice(filled[0], filled[-1] + 1)
        values, errors = counts[kept] * scale[kept], np.sqrt(counts[kept]) * scale[kept]
        edges = edges[filled[0] : filled[-1] + 2]
        line = axes.stairs(np.where(values > 0, values, np.nan), edges, baseline=None, label=label)
        # Below the band of a single muon a logarithmic axis would have no end.
        low = np.maximum(values - errors, 0.1 * values)
        axes.stairs(values + errors, edges, baseline=low, fill=True, alpha=0.3, color=line.get_edgecolor(), lw=0)
