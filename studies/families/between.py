"""Muons between two knots of a family, beside the truth: why maps are interpolated, and not densities.

python -m studies.families.between FAMILY HELD_OUT --knots 10 20

FAMILY is the ONNX file, HELD_OUT a muon file of a depth between two of its knots. Beside the family's spectrum at that
depth stands the mixture of its muons at both knots that has the same mean of ln E: what an interpolation of densities
would make.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime import Generator, Muons
from deepmuon_training.reports.pictures import STYLE
from deepmuon_training.sample import read_sample
from studies.shared.report import COLOURS, write

SEED = 1
EDGES = 10 ** np.linspace(-2, 3, 51)
ENOUGH = 10_000
"""Held-out muons of a bin that is judged."""

Float = NDArray[np.float64]


@click.command(help=__doc__)
@click.argument("family", type=click.Path(exists=True, path_type=Path))
@click.argument("held_out", type=click.Path(exists=True, path_type=Path))
@click.option("--knots", type=float, nargs=2, required=True, help="Depths [m] of the knots on both sides.")
@click.option("-n", "--number", default=10_000_000, show_default=True, help="Muons of the family at each depth.")
def main(family: Path, held_out: Path, knots: tuple[float, float], number: int) -> None:
    """Sample, compare, write."""
    truth = read_sample(held_out)
    spectra = {"held out": spectrum(truth.muons)}
    for depth in (truth.depth_m, *knots):
        muons = Generator.open(file=family, depth=depth).sample(number, SEED)
        spectra[f"{depth:g} m"] = spectrum(muons)
    here = spectra[f"{truth.depth_m:g} m"]
    above, below = (spectra[f"{knot:g} m"] for knot in knots)
    share = (mean(here) - mean(below)) / (mean(above) - mean(below))
    mixture = share * above + (1 - share) * below
    expected = np.where(spectra["held out"] * len(truth) >= ENOUGH, spectra["held out"], np.nan)
    off = {"maps": here / expected - 1, "mixture": mixture / expected - 1}
    noise = np.sqrt((1 / len(truth) + 1 / number) / expected)
    numbers = {
        "family": family.name,
        "depth_m": truth.depth_m,
        "held_out_muons": len(truth),
        "muons": number,
        "knots_m": list(knots),
        "energy_edges_gev": EDGES.tolist(),
        "spectra": {name: one.tolist() for name, one in spectra.items()},
        "mixture": mixture.tolist(),
        "largest_deviation": {name: float(np.nanmax(np.abs(one))) for name, one in off.items()},
        "chi2_per_bin": {name: float(np.nanmean((one / noise) ** 2)) for name, one in off.items()},
    }
    write(Path(__file__), numbers, figure=draw(truth.depth_m, knots, spectra, off, noise))


def spectrum(muons: Muons) -> Float:
    """Share of muons in each bin of energy."""
    return np.histogram(muons.kinetic_energy, EDGES)[0] / len(muons)


def mean(shape: Float) -> float:
    """Mean of ln E of a spectrum."""
    return float(np.average(np.log(EDGES[1:] * EDGES[:-1]) / 2, weights=shape))


def draw(
    depth: float, knots: tuple[float, float], spectra: dict[str, Float], off: dict[str, Float], noise: Float
) -> Figure:
    """Draw the spectra, and below them what differs from the truth."""
    with rc_context(STYLE):
        figure = Figure(figsize=(7, 6), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
        upper.stairs(spectra["held out"], EDGES, fill=True, alpha=0.25, color="black", label=f"held out, {depth:g} m")
        upper.stairs(spectra[f"{depth:g} m"], EDGES, color=COLOURS[0], label=f"the family at {depth:g} m")
        for knot, colour in zip(knots, COLOURS[2:], strict=False):
            upper.stairs(spectra[f"{knot:g} m"], EDGES, color=colour, ls=":", label=f"its knot of {knot:g} m")
        upper.set(xscale="log", ylabel="share of muons in 0.1 decade")
        upper.legend(frameon=False)
        _draw_deviation(lower, off, noise, depth)
    return figure


def _draw_deviation(axes: Axes, off: dict[str, Float], noise: Float, depth: float) -> None:
    names = {"maps": "maps interpolated", "mixture": "a mixture of both knots"}
    axes.stairs(100 * noise, EDGES, baseline=-100 * noise, fill=True, alpha=0.25, color="black", label="noise")
    for (name, deviation), colour in zip(off.items(), COLOURS, strict=False):
        axes.stairs(100 * deviation, EDGES, color=colour, label=names[name], baseline=None)
    axes.axhline(0, color="black", lw=0.6)
    axes.set(xlabel="kinetic energy / GeV", ylabel=f"off the truth at {depth:g} m / %", ylim=(-4, 4))
    axes.legend(frameon=False, ncols=3)


if __name__ == "__main__":
    main()
