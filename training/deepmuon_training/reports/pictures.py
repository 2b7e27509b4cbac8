"""Pictures of an evaluation: energy spectrum, zenith, charge, each with a ratio panel.

Bands and error bars are one standard deviation of independent muons: the band of the held-out ones, the
bars of the generated ones. Bins with fewer than 25 muons (zenith: 1, charge: 100) are not drawn; a triangle
stands for a ratio beyond its panel.
"""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_training.data.cry_cells import COS_ZENITH_EDGES
from deepmuon_training.scores.evaluation import Evaluation, Spectra
from deepmuon_training.scores.histograms import ENERGY_EDGES

__all__ = ["STYLE", "draw_charge", "draw_energy", "draw_pictures", "draw_zenith"]

STYLE: dict[Any, Any] = {
    "font.size": 10,
    "legend.frameon": False,
    "xtick.direction": "in",
    "xtick.top": True,
    "xtick.minor.visible": True,
    "ytick.direction": "in",
    "ytick.right": True,
    "ytick.minor.visible": True,
}
_BLUE, _RED = "#1f4e9e", "#c1272d"
_FEWEST, _FEWEST_FOR_FRACTION = 25, 100
_WIDEST, _NARROWEST = 0.3, 0.02  # half the height of a ratio panel

Float = NDArray[np.float64]


class _Curve(NamedTuple):
    """Values and standard deviations by bin; NaN where there are too few muons."""

    value: Float
    error: Float


def draw_pictures(evaluation: Evaluation, folder: str | PathLike[str], title: str = "") -> tuple[Path, ...]:
    """Draw energy.png, zenith.png and charge.png into an existing folder, and return their paths."""
    paths = []
    for name, draw in (("energy", draw_energy), ("zenith", draw_zenith), ("charge", draw_charge)):
        paths.append(Path(folder) / f"{name}.png")
        draw(evaluation, title).savefig(paths[-1])
    return tuple(paths)


def draw_energy(evaluation: Evaluation, title: str = "") -> Figure:
    """Draw the energy spectrum, ten bins to a decade, as E dN/dE of a unit rate."""

    def spectrum(spectra: Spectra) -> _Curve:
        counts = np.add(spectra.plus_by_energy, spectra.minus_by_energy)
        return _density(counts[1:-1], np.log(ENERGY_EDGES), counts.sum())

    labels = {
        "xlabel": "kinetic energy E [GeV]",
        "ylabel": "(1/N) dN/d ln E",
        "xscale": "log",
        "yscale": "log",
    }
    return _draw(evaluation, spectrum, ENERGY_EDGES, title, **labels)


def draw_zenith(evaluation: Evaluation, title: str = "") -> Figure:
    """Draw the density of cos zenith, in CRY's bins."""

    def spectrum(spectra: Spectra) -> _Curve:
        counts = np.array(spectra.by_cos_zenith)
        return _density(counts, COS_ZENITH_EDGES, counts.sum(), fewest=1)  # to the horizon, however few

    labels = {"xlabel": "cos zenith", "ylabel": "(1/N) dN/d cos zenith", "yscale": "log"}
    return _draw(evaluation, spectrum, COS_ZENITH_EDGES, title, **labels)


def draw_charge(evaluation: Evaluation, title: str = "") -> Figure:
    """Draw the fraction of mu+ by energy, in CRY's bins."""

    def fraction(spectra: Spectra) -> _Curve:
        plus, minus = (
            np.reshape(counts[1:-1], (-1, 2)).sum(axis=1)
            for counts in (spectra.plus_by_energy, spectra.minus_by_energy)
        )
        total = _enough(plus + minus, _FEWEST_FOR_FRACTION)
        value = plus / total
        return _Curve(value, np.sqrt((plus + 1) * (minus + 1) / total) / total)  # no zero error for one charge alone

    labels = {"xlabel": "kinetic energy E [GeV]", "ylabel": "fraction of μ⁺", "xscale": "log"}
    return _draw(evaluation, fraction, ENERGY_EDGES[::2], title, **labels)


def _enough(counts: NDArray[np.int64], fewest: int = _FEWEST) -> Float:
    """Replace counts by NaN where they are too few to draw."""
    return np.where(counts >= fewest, counts, np.nan)


def _density(counts: NDArray[np.int64], edges: Float, total: int, fewest: int = _FEWEST) -> _Curve:
    """Turn counts into a density of unit integral over all muons, seen or not."""
    drawn, scale = _enough(counts, fewest), total * np.diff(edges)
    return _Curve(drawn / scale, np.sqrt(drawn) / scale)


def _draw(evaluation: Evaluation, curve: Callable[[Spectra], _Curve], edges: Float, title: str, **axes: str) -> Figure:
    """Draw one quantity of both samples over its bins, and their ratio underneath."""
    generated, held_out = curve(evaluation.generated_spectra), curve(evaluation.held_out_spectra)
    unit = np.where(held_out.value > 0, held_out.value, np.nan)
    ratio = _Curve(generated.value / unit, generated.error / unit)
    with rc_context(STYLE):
        figure = Figure(figsize=(6.0, 5.0), dpi=150, layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[5, 2])
        upper.set(title=title, ylabel=axes.pop("ylabel"), yscale=axes.pop("yscale", "linear"))
        lower.set(ylabel="ratio", ylim=_ratio_limits(ratio), xlim=(edges[0], edges[-1]), **axes)
        upper.legend(
            _draw_panel(upper, edges, generated, held_out),
            [
                f"held-out, {evaluation.held_out_muons:,} muons (band: 1σ)",
                f"generated, {evaluation.generated_muons:,} muons",
            ],
        )
        _draw_panel(lower, edges, ratio, _Curve(unit / unit, held_out.error / unit))
        _mark_beyond(lower, edges, ratio.value)
        figure.align_ylabels()
    return figure


def _draw_panel(axes: Axes, edges: Float, generated: _Curve, held_out: _Curve) -> list[Any]:
    """Draw held-out values as a line with a band, generated ones as points with bars; return what to name."""
    low, high = held_out.value - held_out.error, held_out.value + held_out.error
    band = axes.stairs(high, edges, baseline=low, fill=True, color=_BLUE, alpha=0.25, lw=0)
    line = axes.stairs(held_out.value, edges, baseline=None, color=_BLUE, lw=1.0)
    points = axes.errorbar(_centres(axes, edges), *generated, fmt="o", color=_RED, ms=2.5, elinewidth=0.9)
    return [(band, line), points]


def _mark_beyond(axes: Axes, edges: Float, value: Float) -> None:
    """Draw a triangle at the edge of a panel for each value beyond it."""
    low, high = axes.get_ylim()
    for beyond, edge, marker in ((value > high, high, "^"), (value < low, low, "v")):
        axes.plot(_centres(axes, edges)[beyond], np.full(beyond.sum(), edge), marker, color=_RED, ms=5, clip_on=False)


def _centres(axes: Axes, edges: Float) -> Float:
    centres: Float = np.sqrt(edges[1:] * edges[:-1]) if axes.get_xscale() == "log" else (edges[1:] + edges[:-1]) / 2
    return centres


def _ratio_limits(ratio: _Curve) -> tuple[float, float]:
    """Limits that show every well-measured point, alike above and below 1."""
    known = ratio.error < _WIDEST / 3
    farthest = np.max(np.abs(ratio.value - 1)[known] + 2 * ratio.error[known], initial=_NARROWEST)
    half = min(float(farthest), _WIDEST)
    return 1 - half, 1 + half
