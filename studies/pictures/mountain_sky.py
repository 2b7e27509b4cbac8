"""Muons behind a made-up mountain, true and learned: ``python -m studies.pictures.mountain_sky WORK``.

Fits a `quantile` generator with a learned azimuth to those of 1,500,000 muons of the parametric flux that the rock lets
through, and draws docs/images/mountain.png against others. The generator is kept in the folder WORK.
Two minutes on one core.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import torch
from matplotlib.axes import Axes
from numpy.typing import NDArray

from deepmuon_runtime import Generator, Muons
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import FittedGenerator, export_fitted
from deepmuon_training.generators.quantile.azimuth_fit import AZIMUTH_SCHEDULE
from deepmuon_training.generators.quantile.fit import QuantileSettings
from deepmuon_training.sample import Sample
from studies.pictures.mountain import behind_mountain, skyline
from studies.shared.processes import REPOSITORY

PICTURE = REPOSITORY / "docs" / "images" / "mountain.png"
MUONS = 1_500_000
SETTINGS = QuantileSettings(azimuth=replace(AZIMUTH_SCHEDULE, steps=1000))
ENERGIES = {"below 3 GeV": (0.0, 3.0), "3 to 30 GeV": (3.0, 30.0), "above 30 GeV": (30.0, np.inf)}
LOW = 0.6
"""Cosine of the zenith angle below which a muon is low in the sky."""

Float = NDArray[np.float64]


def main(work: Path) -> None:
    """Fit, generate and draw."""
    torch.set_num_threads(1)
    work.mkdir(exist_ok=True)
    if not (work / "generator.pt").exists():
        sample = Sample(behind_mountain(sea_level_muons(MUONS, seed=1)), 0.0, "behind a made-up mountain")
        fit_generator(sample, "quantile", seed=1, settings=SETTINGS, azimuth="learned").save(work / "generator.pt")
    export_fitted(FittedGenerator.load(work / "generator.pt"), work / "model.onnx", overwrite=True)
    true = behind_mountain(sea_level_muons(MUONS, seed=2))
    learned = Generator.open(file=work / "model.onnx", device="cpu").sample(len(true), seed=1)
    figure = plt.figure(figsize=(9, 6.4), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=[5, 4])
    skies = upper.subplots(1, 2, subplot_kw={"projection": "polar"})
    for axes, muons, name in zip(skies, (true, learned), ("true", "learned"), strict=True):
        draw_sky(axes, muons, name)
    for axes, name in zip(lower.subplots(1, 3), ENERGIES, strict=True):
        draw_azimuth(axes, true, learned, name)
    figure.savefig(PICTURE, dpi=120)


def from_north(muons: Muons) -> Float:
    """Angle [rad] from north of where muons come from."""
    return np.arctan2(-muons.u, -muons.v).astype(np.float64)


def draw_sky(axes: Axes, muons: Muons, name: str) -> None:
    """Draw how many muons come from where, over an evenly lit sky; the line is the mountain's edge."""
    angles, cosines = np.linspace(-np.pi, np.pi, 73), np.linspace(0, 1, 21)
    counts = np.histogram2d(from_north(muons), muons.cos_zenith, [angles, cosines])[0]
    relative = counts / np.maximum(counts[[0, -1]].mean(axis=0), 1)  # to those from the south
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)  # as on a map: east is on the right
    zenith = np.degrees(np.arccos(cosines))
    axes.pcolormesh(angles, zenith, relative.T, vmin=0, vmax=1.1, cmap="cividis")
    axes.plot(angles, 90 - np.degrees(skyline(angles)), color="#d1495b", lw=1.2)
    axes.set(title=name, ylim=(0, 90), yticks=[30, 60], xticks=np.radians([0, 90, 180, 270]))
    axes.set_xticklabels(["N", "E", "S", "W"])
    axes.grid(False)


def draw_azimuth(axes: Axes, true: Muons, learned: Muons, name: str) -> None:
    """Draw the azimuth of muons low in the sky, of one range of energies."""
    edges = np.linspace(-180, 180, 49)
    for muons, style in ((true, {"color": "#1f4e9e", "fill": True, "alpha": 0.35}), (learned, {"color": "#c1272d"})):
        low, high = ENERGIES[name]
        inside = (muons.cos_zenith < LOW) & (muons.kinetic_energy >= low) & (muons.kinetic_energy < high)
        counts = np.histogram(np.degrees(from_north(muons)[inside]), edges)[0]
        axes.stairs(
            counts * (len(edges) - 1) / counts.sum(), edges, label="true" if "fill" in style else "learned", **style
        )
    axes.set_title(f"{name}, zenith above 53°", fontsize=10)
    axes.set(xlabel="angle from north / °", xticks=[-180, -90, 0, 90, 180], ylim=(0, None))
    axes.legend(frameon=False, loc="lower left")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
