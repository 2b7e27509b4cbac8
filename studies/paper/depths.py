"""Rate, energy and zenith angle by depth, generators against muons carried by Geant4 (the paper's figures 5 to 7).

    python -m studies.paper.depths --samples FOLDER --layered FOLDER

The first folder holds the held-out muons as testing-0m.h5 to testing-50m.h5 (`models/make.py` leaves them in
WORK/samples); the other one the `quantile` generators of a layered run as quantile-0m.onnx and so on.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime import Generator, Muons, list_models
from deepmuon_training.reports.pictures import STYLE
from deepmuon_training.sample import read_sample
from studies.shared.judged import GENERATED, distances
from studies.shared.options import FOLDER
from studies.shared.report import COLOURS, write
from studies.shared.trained import SEED

ENERGY_EDGES = 10.0 ** np.linspace(-2, 3.5, 56)
COS_EDGES = np.linspace(0, 1, 41)
COMPARED = (10, 50)
"""Depths [m] whose spectra are drawn."""

Float = NDArray[np.float64]


@click.command(help=__doc__)
@click.option("--samples", required=True, type=FOLDER, help="Where the held-out muons lie.")
@click.option("--layered", required=True, type=FOLDER, help="Where the generators of a layered run lie.")
def main(samples: Path, layered: Path) -> None:
    """Compare released and layered generators with the direct muons of each depth."""
    depths = sorted({round(model.depth_m) for model in list_models()})
    numbers, drawn = {}, {}
    for depth in depths:
        direct = read_sample(samples / f"testing-{depth}m.h5")
        generators = {
            "released": Generator.open(depth, architecture="quantile"),
            "layered": Generator.open(file=layered / f"quantile-{depth}m.onnx"),
        }
        muons = {name: generator.sample(GENERATED, seed=SEED) for name, generator in generators.items()}
        numbers[depth] = {
            "direct": moments(direct.muons, direct.rate),
            **{
                name: moments(muons[name], generators[name].model.rate_hz_per_m2) | distances(muons[name], direct.muons)
                for name in generators
            },
        }
        drawn[depth] = {"direct": spectra(direct.muons), **{name: spectra(muons[name]) for name in muons}}
    write(Path(__file__), {"generated": GENERATED, "depths": numbers}, table(numbers), draw(numbers, drawn))


def moments(muons: Muons, rate: float | None) -> dict[str, float | None]:
    """Rate, and means with their standard errors."""
    energy = muons.kinetic_energy.astype(np.float64)
    x = (9000 * energy + 1) ** (1 / 9)
    zenith = np.degrees(np.arccos(np.minimum(muons.cos_zenith.astype(np.float64), 1)))
    scale = 1 / np.sqrt(len(muons))
    return {
        "muons": len(muons),
        "rate": rate,
        "mean_energy": float(energy.mean()),
        "mean_energy_error": float(energy.std() * scale),
        "median_energy": float(np.median(energy)),
        "mean_box_cox": float(x.mean()),
        "mean_zenith": float(zenith.mean()),
        "mean_zenith_error": float(zenith.std() * scale),
    }


def spectra(muons: Muons) -> tuple[Float, Float]:
    """Fractions of the muons in bins of the energy, and of cos zenith."""
    return (
        np.histogram(muons.kinetic_energy, ENERGY_EDGES)[0] / len(muons),
        np.histogram(muons.cos_zenith, COS_EDGES)[0] / len(muons),
    )


def table(numbers: dict[int, dict[str, dict[str, float | None]]]) -> list[tuple[str, ...]]:
    """One row a depth and kind."""
    rows = [("muons", "rate", "zenith", "energy", "to direct", "χ²/ndf", "delta", "KS (noise)")]
    for depth, kinds in numbers.items():
        direct = kinds["direct"]
        for name, of in kinds.items():
            ratio = of["mean_energy"] / direct["mean_energy"]
            error = ratio * np.hypot(*(each["mean_energy_error"] / each["mean_energy"] for each in (of, direct)))
            scores = ("", "", "", "")
            if "delta" in of:
                scores = (
                    short(ratio, error, 4),
                    f"{of['chi2_ndf']:.2f}",
                    f"{of['delta']:.2%}",
                    f"{of['ks_energy']:.4f} ({of['ks_noise']:.4f})",
                )
            rate = "unknown" if of["rate"] is None else f"{of['rate']:.3f}"
            energy = short(of["mean_energy"], of["mean_energy_error"], 3)
            zenith = short(of["mean_zenith"], of["mean_zenith_error"], 3)
            rows.append((f"{depth} m, {name}", rate, zenith, energy, *scores))
    return rows


def short(value: float, error: float, digits: int) -> str:
    """Write 17.968 with an error of 0.058 as 17.968(58)."""
    return f"{value:.{digits}f}({max(1, round(error * 10**digits))})"


def draw(
    numbers: dict[int, dict[str, dict[str, float | None]]], drawn: dict[int, dict[str, tuple[Float, Float]]]
) -> Figure:
    """Draw rate, mean energy and mean zenith by depth, and the spectra of two depths with their ratios to direct."""
    depths = list(numbers)
    with rc_context(STYLE):
        figure = Figure(figsize=(10.5, 9.0), layout="constrained")
        top, bottom = figure.subfigures(2, 1, height_ratios=[3, 5])
        labels = {"rate": "rate / (m² s)", "mean_energy": "mean energy / GeV", "mean_zenith": "mean zenith / °"}
        for axes, (key, label) in zip(top.subplots(1, 3), labels.items(), strict=True):
            for name, marker, color in zip(("direct", "released", "layered"), "o+x", ("black", *COLOURS), strict=False):
                values = [numbers[depth][name][key] for depth in depths]
                errors = [numbers[depth][name].get(f"{key}_error", 0.0) for depth in depths]
                axes.errorbar(depths, values, errors, fmt=marker, color=color, label=name, fillstyle="none")
            axes.set(xlabel="depth / m", ylabel=label)
        top.axes[0].set(yscale="log")
        top.axes[0].legend()
        grid = bottom.subplots(2, 4, sharex="col", height_ratios=[5, 2])
        shown = [depth for depth in COMPARED if depth in drawn]
        for k, depth in enumerate(shown):
            for column, edges, log in ((0, ENERGY_EDGES, True), (1, COS_EDGES, False)):
                curves = {name: of[column] for name, of in drawn[depth].items()}
                draw_spectrum(grid[:, 2 * k + column], curves, numbers[depth]["direct"]["muons"], edges, log)
                grid[0, 2 * k + column].set(title=f"{depth} m")
        grid[0, 0].legend(fontsize="small")
    return figure


def draw_spectrum(
    pair: NDArray[np.object_], curves: dict[str, Float], direct_muons: float, edges: Float, log: bool
) -> None:
    """Draw fractions above, below their ratios to the direct ones, whose noise is grey."""
    upper, lower = pair
    direct = np.where(curves["direct"] * direct_muons >= 25, curves["direct"], np.nan)
    for (name, values), color in zip(curves.items(), ("black", *COLOURS), strict=False):
        upper.stairs(values, edges, baseline=None, color=color, label=name)
        lower.stairs(values / direct, edges, baseline=None, color=color)
    noise = 1 / np.sqrt(direct * direct_muons)
    lower.stairs(1 + noise, edges, baseline=1 - noise, fill=True, color="0.85", zorder=0)
    upper.set(yscale="log", xscale="log" if log else "linear", ylim=(1e-6, None))
    lower.set(ylim=(0.9, 1.1), xlabel="kinetic energy / GeV" if log else "cos zenith")


if __name__ == "__main__":
    main()
