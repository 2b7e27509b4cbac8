"""Draws docs/images/muons.png, of freshly generated muons: ``python -m studies.pictures.muons``."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from deepmuon_runtime import Generator, Muons
from studies.shared.processes import REPOSITORY

PICTURE = REPOSITORY / "docs" / "images" / "muons.png"
MUONS = 10_000_000
FEWEST = 20  # of a bin that is drawn
SEED = 1
COLOURS = {0: "#d1495b", 10: "#e08d3c", 100: "#8a9a3b", 1000: "#00638a", 5000: "#3b3a78"}  # by depth [m]
ENERGY_EDGES = np.geomspace(2e-3, 2e4, 141)
ZENITH_EDGES = np.linspace(0, 90, 91)

STYLE = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#444444",
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "axes.axisbelow": True,
    "figure.facecolor": "white",
}

Float = NDArray[np.float64]


def main() -> None:
    """Draw energies and zenith angles of the measured flux, from sea level to the bottom of the sea."""
    with plt.rc_context(STYLE):
        figure, (energy, zenith) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
        for depth in COLOURS:
            generator = Generator.open(depth, flux="measured")
            muons = generator.sample(MUONS, seed=SEED)
            rate = generator.model.rate_hz_per_m2 or 1.0
            draw(energy, depth, ENERGY_EDGES, energy_spectrum(muons, rate))
            draw(zenith, depth, ZENITH_EDGES, zenith_distribution(muons))
        energy.set(xscale="log", yscale="log", ylim=(1e-10, 100))
        energy.set(xlabel="kinetic energy / GeV", ylabel=r"$E\,\mathrm{d}\Phi/\mathrm{d}E$  /  m$^{-2}$ s$^{-1}$")
        zenith.set(xlim=(0, 90), xticks=range(0, 91, 15), ylim=(0, None))
        zenith.set(xlabel="zenith angle / °", ylabel="share of muons per degree")
        zenith.legend(frameon=False, fontsize="small", handlelength=1.2)
        figure.savefig(PICTURE, dpi=130)


def energy_spectrum(muons: Muons, rate: float) -> Float:
    """Flux through a horizontal plane per unit of log energy [1/(m2 s)]; NaN where there are too few muons to tell."""
    counts = np.histogram(muons.kinetic_energy, ENERGY_EDGES)[0]
    flux = counts * (rate / len(muons)) / np.diff(np.log(ENERGY_EDGES))
    return np.where(counts >= FEWEST, flux, np.nan)


def zenith_distribution(muons: Muons) -> Float:
    """Share of the muons through a horizontal plane per degree of zenith angle."""
    zenith = np.degrees(np.arctan2(np.hypot(muons.u, muons.v), muons.cos_zenith))
    return np.histogram(zenith, ZENITH_EDGES, density=True)[0]


def draw(axes: Axes, depth: int, edges: Float, values: Float) -> None:
    """Draw one distribution as a filled step line."""
    axes.stairs(
        values,
        edges,
        baseline=None,
        color=COLOURS[depth],
        linewidth=1.6,
        label=f"{depth:,} m of water" if depth else "sea level",
    )


if __name__ == "__main__":
    main()
