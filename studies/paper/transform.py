"""The energy spectrum before and after the transform (the paper's figure 1).

python -m studies.paper.transform sea_level.h5
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import kurtosis, skew

from deepmuon_runtime import read_muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.reports.pictures import STYLE
from studies.shared.report import COLOURS, write

Float = NDArray[np.float64]


@click.command(help=__doc__)
@click.argument("sample", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def main(sample: Path) -> None:
    """Transform the sample's energies, measure and draw them."""
    energy = read_muons(sample).kinetic_energy.astype(np.float64)
    transform = EnergyTransform.fit(energy.astype(np.float32))
    pre_tanh = np.asarray(transform.pre_tanh(energy), dtype=np.float64)
    columns = {
        "kinetic energy E / MeV": 1000 * energy,
        "x = (9 E + 1)^(1/9)": pre_tanh + transform.mean,
        "tanh(x - mean)": np.tanh(pre_tanh),
    }
    moments = {name: shape(values) for name, values in columns.items()}
    rows = [("", "mean", "standard deviation", "skewness", "kurtosis")]
    rows += [(name, *(f"{value:.4g}" for value in row.values())) for name, row in moments.items()]
    write(Path(__file__), {"muons": len(energy), "columns": moments}, rows, draw(columns))


def shape(values: Float) -> dict[str, float]:
    """Mean, standard deviation, skewness, and kurtosis (3 for a normal distribution)."""
    return {
        "mean": float(values.mean()),
        "standard_deviation": float(values.std()),
        "skewness": float(skew(values)),
        "kurtosis": float(kurtosis(values, fisher=False)),
    }


def draw(columns: dict[str, Float]) -> Figure:
    """Draw a histogram of each column."""
    with rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.2), layout="constrained")
        for axes, (name, values), color in zip(figure.subplots(1, 3), columns.items(), COLOURS, strict=False):
            axes.hist(values, bins=100, density=True, color=color, alpha=0.8)
            axes.set(xlabel=name, ylabel="density")
        figure.axes[0].set(yscale="log")
    return figure


if __name__ == "__main__":
    main()
