"""Energy spectra of all muons, near the vertical and around 60 degrees, generators against CRY (the paper's figure 3).

python -m studies.paper.sea_level held_out.h5
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime import Generator, Muons, read_muons
from deepmuon_training.reports.pictures import STYLE
from studies.shared.judged import GENERATED
from studies.shared.report import COLOURS, write
from studies.shared.trained import SEED

EDGES = 10.0 ** np.linspace(-2, 3, 51)
FEWEST = 400  # muons in a bin that is judged
ANGLES = {"all": (0.0, 90.0), "0° to 10°": (0.0, 10.0), "55° to 65°": (55.0, 65.0)}
ARCHITECTURES = ("quantile", "transformer")

Float = NDArray[np.float64]


@click.command(help=__doc__)
@click.argument("held-out", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def main(held_out: Path) -> None:
    """Compare the spectra of each range of zenith angles."""
    truth = read_muons(held_out)
    generators = {name: Generator.open(0, architecture=name) for name in ARCHITECTURES}
    muons = {name: generator.sample(GENERATED, seed=SEED) for name, generator in generators.items()}
    numbers, rows = {}, [("zenith", "generator", "muons held out", "chi2 / bins", "rms deviation", "noise")]
    spectra = {}
    for angle, limits in ANGLES.items():
        expected = counts(truth, limits)
        spectra[angle] = {"held-out CRY": (expected, len(truth))}
        for name in ARCHITECTURES:
            found = counts(muons[name], limits)
            spectra[angle][name] = (found, GENERATED)
            score = compare(found, expected, GENERATED / len(truth))
            numbers[f"{name}, {angle}"] = score
            rows.append((angle, name, f"{expected.sum():,}", *(f"{value:.3g}" for value in score.values())))
    write(Path(__file__), {"held_out": len(truth), "generated": GENERATED, "scores": numbers}, rows, draw(spectra))


def counts(muons: Muons, limits: tuple[float, float]) -> NDArray[np.int64]:
    """Histogram of the energy within limits of the zenith angle [degrees]."""
    low, high = np.cos(np.radians(limits[1])), np.cos(np.radians(limits[0]))
    inside = (muons.cos_zenith > low) & (muons.cos_zenith <= high)
    return np.histogram(muons.kinetic_energy[inside], EDGES)[0]


def compare(found: NDArray[np.int64], expected: NDArray[np.int64], scale: float) -> dict[str, float]:
    """Compare bins that hold enough muons: chi2 per bin, rms of the deviation, and what noise makes of it."""
    enough = expected >= FEWEST
    p, q = found[enough], expected[enough]
    variance = 1 / p + 1 / q
    deviation = p / (scale * q) - 1
    return {
        "chi2_per_bin": float(np.mean(deviation**2 / variance)),
        "rms": float(np.sqrt(np.mean(deviation**2))),
        "noise": float(np.sqrt(np.mean(variance))),
    }


def draw(spectra: dict[str, dict[str, tuple[NDArray[np.int64], int]]]) -> Figure:
    """Draw the spectra and their ratios to the held-out muons."""
    center = np.sqrt(EDGES[1:] * EDGES[:-1])
    with rc_context(STYLE):
        figure = Figure(figsize=(10.5, 4.6), layout="constrained")
        axes = figure.subplots(2, 3, sharex=True, height_ratios=[5, 2])
        for (angle, curves), upper, lower in zip(spectra.items(), *axes, strict=True):
            expected, muons = curves["held-out CRY"]
            unit = np.where(expected >= 25, expected, np.nan) / muons
            upper.stairs(unit, EDGES, baseline=None, color="black", label="held-out CRY")
            for (name, (found, n)), color in zip(list(curves.items())[1:], COLOURS, strict=False):
                upper.plot(center, found / n, ".", ms=3, color=color, label=name)
                lower.plot(center, found / n / unit, ".", ms=3, color=color)
            band = 1 / np.sqrt(np.where(expected >= 25, expected, np.nan))
            lower.fill_between(center, 1 - band, 1 + band, color="0.85", step="mid")
            upper.set(title=angle, xscale="log", yscale="log", ylim=(1e-7, None))
            lower.set(ylim=(0.8, 1.2), xlabel="kinetic energy / GeV")
        axes[0, 0].set(ylabel="fraction of all muons in a bin")
        axes[1, 0].set(ylabel="ratio")
        axes[0, 0].legend(fontsize="small")
    return figure


if __name__ == "__main__":
    main()
