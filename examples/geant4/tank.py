"""A sphere of lead in a tank under forty metres of water, seen by muons.

    python examples/geant4/tank.py -n 200000

The tank is 10 m deep and 20 m x 20 m wide, the sphere in its middle has a radius of 2 m. Muons are drawn from the
released model of --depth, and Geant4 carries them through the tank, with the sphere and without. Then it is measured
how many muons a second of computing brings to the tank's top: drawn from that model; or drawn from the one of sea
level, on an area of 200 m x 200 m, and carried through the water above the tank. 10,000 muons take about half a minute
of computing, shared by the cores, and so 200,000 about five minutes on two.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_training.transport.geant4_data import without_data_sets

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIMULATION = Path(__file__).with_name("simulation.py")
TANK = {"width": 20.0, "height": 10.0}  # m
RADIUS = 2.0  # m
SURFACE_WIDTH = 200.0  # m; from the edge of a tank under 40 m of water it ends at 66 degrees from the vertical
FILM = 1e-3  # m; so little water takes no time
LEAST_LOSS = 0.18  # GeV per m; a muon whose E |w| is less does not arrive
REPETITIONS = 3


@dataclass(frozen=True)
class Crossings:
    """Muons that came through the tank's bottom, n of them."""

    impact: NDArray[np.float64]  # m, distance of the incoming straight line from the tank's middle
    angle: NDArray[np.float64]  # rad, between the directions into the tank and out of it
    middle: NDArray[np.float64]  # m [n, 2], where the incoming straight line crosses the plane of the sphere's centre

    @classmethod
    def of(cls, exits: dict[str, NDArray[np.float64]]) -> Crossings:
        """Take the muons that left by the bottom."""
        bottom = at_bottom(exits, TANK["height"])
        into, out = (np.stack([exits[name + end][bottom] for name in "uvw"], axis=1) for end in ("0", ""))
        start = np.stack([exits["x0"], exits["y0"], np.full(len(bottom), TANK["height"] / 2)], axis=1)[bottom]
        impact = np.linalg.norm(np.cross(start, into), axis=1)
        angle = np.arctan2(np.linalg.norm(np.cross(into, out), axis=1), np.sum(into * out, axis=1))
        return cls(impact, angle, (start - into * (start[:, 2:] / into[:, 2:]))[:, :2])

    @property
    def through(self) -> NDArray[np.bool_]:
        """Whether the incoming straight line meets the sphere, or where it would be."""
        return self.impact < RADIUS


@click.command(help=__doc__)
@click.option("-n", "--number", type=click.IntRange(min=1), default=100_000, show_default=True, help="Muons.")
@click.option("--depth", default=40.0, show_default=True, metavar="METRES", help="Of water above the tank.")
@click.option("--seed", default=1, show_default=True)
@click.option("-o", "--output", type=click.Path(path_type=Path), default="tank.png", show_default=True, help="Picture.")
def main(number: int, depth: float, seed: int, output: Path) -> None:
    """Simulate, print the figures as Markdown, draw the picture."""
    tank = {"depth": depth, "muons": number, "seed": seed, **TANK}
    crossings = [Crossings.of(exits) for exits in simulate([{**tank, "radius": r} for r in (0.0, RADIUS)])]
    click.echo(muon_table(number, *crossings))
    click.echo()
    click.echo(speed_table(number, depth, seed))
    draw(*crossings, number, depth).savefig(output, dpi=80)


def simulate(scenes: list[dict[str, float]]) -> list[dict[str, NDArray[np.float64]]]:
    """Run scenes (`simulation.Scene`), each in a process of its own, one process a core."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(simulate_apart, scenes))


def simulate_apart(scene: dict[str, float]) -> dict[str, NDArray[np.float64]]:
    """Run a scene; its result counts, not the exit code."""
    with tempfile.TemporaryDirectory() as folder:
        question, answer = Path(folder) / "scene.json", Path(folder) / "result.npz"
        question.write_text(json.dumps(scene))
        command = [sys.executable, str(SIMULATION), str(question), str(answer)]
        ended = subprocess.run(command, env=without_data_sets(), stdin=subprocess.DEVNULL, capture_output=True)
        if not answer.exists():
            raise click.ClickException(f"Geant4 failed: {ended.stderr.decode(errors='replace')[-600:]}")
        with np.load(answer) as arrays:
            return dict(arrays)


def at_bottom(exits: dict[str, NDArray[np.float64]], height: float) -> NDArray[np.bool_]:
    """Return which muons left a block by its bottom, downwards."""
    return (exits["z"] < 1e-9 - height / 2) & (exits["w"] < 0)


def muon_table(number: int, without: Crossings, sphere: Crossings) -> str:
    """Return what the sphere does to the muons."""
    lines = ["| of the muons that entered the tank | without | with the sphere |", "|---|--:|--:|"]
    for what, kept in (
        ("crossed its bottom", [np.ones(len(c.angle), bool) for c in (without, sphere)]),
        ("... and aimed at the sphere", [c.through for c in (without, sphere)]),
    ):
        counts = [f"{np.sum(mask):,} ± {math.sqrt(np.sum(mask)):.0f}" for mask in kept]
        lines.append(f"| {what} | {counts[0]} | {counts[1]} |")
    angles = [median_with_error(1e3 * c.angle[c.through]) for c in (without, sphere)]
    lines.append("| median scattering angle of those [mrad] | " + " | ".join(angles) + " |")
    return f"{number:,} muons entered the tank.\n\n" + "\n".join(lines)


def median_with_error(values: NDArray[np.float64]) -> str:
    """Return a median and its standard error, from the order statistics half a square root of n away."""
    n = len(values)
    if n < 10:
        return "too few"
    low, high = np.quantile(values, [0.5 - 0.5 / math.sqrt(n), 0.5 + 0.5 / math.sqrt(n)])
    return f"{np.median(values):.1f} ± {(high - low) / 2:.1f}"


def speed_table(number: int, depth: float, seed: int) -> str:
    """Return how many muons one core brings to the tank's top in a second."""
    film = {"depth": depth, "muons": number, "width": TANK["width"], "height": FILM}
    above = {"depth": 0.0, "muons": number, "width": SURFACE_WIDTH, "height": depth}
    ways = {
        f"drawn from the model of {depth:g} m": film,
        f"through {depth:g} m of water": above,
        "the same, without those that can't arrive": {**above, "least_energy": LEAST_LOSS * depth},
    }
    lines = ["| how muons come to the tank's top | reached it, of | per second of one core |", "|---|--:|--:|"]
    for name, way in ways.items():
        runs = [{**way, "radius": 0.0, "seed": seed + repetition} for repetition in range(REPETITIONS)]
        results = simulate(runs)
        counts = [int(np.sum(arrived(exits, way["height"]))) for exits in results]
        rates = [count / float(exits["seconds"]) for count, exits in zip(counts, results, strict=True)]
        error = np.std(rates, ddof=1) / math.sqrt(REPETITIONS)
        lines.append(f"| {name} | {sum(counts):,} of {REPETITIONS * number:,} | {np.mean(rates):,.1f} ± {error:,.1f} |")
    return "\n".join(lines)


def arrived(exits: dict[str, NDArray[np.float64]], height: float) -> NDArray[np.bool_]:
    """Return which muons left a block downwards, on the tank's top."""
    half = TANK["width"] / 2
    return at_bottom(exits, height) & (np.abs(exits["x"]) < half) & (np.abs(exits["y"]) < half)


def draw(without: Crossings, sphere: Crossings, number: int, depth: float) -> Figure:
    """Draw what the sphere does to angles and numbers, and the tank seen from above by angles."""
    figure = Figure(figsize=(12, 3.8), layout="constrained")
    figure.suptitle(f"A sphere of lead ({RADIUS:g} m) under {depth:g} m of water, {number:,} muons each")
    angles, counts, image = figure.subplots(1, 3)
    for crossings, name in ((without, "without"), (sphere, "with the sphere")):
        angles.hist(1e3 * crossings.angle[crossings.through], np.linspace(0, 150, 31), histtype="step", label=name)
        counts.hist(crossings.impact, np.linspace(0, 6, 25), histtype="step", label=name)
    angles.set(xlabel="scattering angle [mrad]", ylabel="muons aimed at the sphere")
    counts.set(xlabel="distance of the way in from the middle [m]", ylabel="muons that crossed the tank")
    counts.axvline(RADIUS, color="grey", linestyle=":")
    for axes in (angles, counts):
        axes.legend(frameon=False)
    draw_image(image, sphere)
    return figure


def draw_image(axes: Axes, crossings: Crossings) -> None:
    """Draw the mean scattering angle over the plane of the sphere's centre."""
    edges = np.linspace(-6, 6, 25)
    x, y = crossings.middle.T
    total = np.histogram2d(x, y, [edges, edges], weights=np.minimum(1e3 * crossings.angle, 150))[0]
    muons = np.histogram2d(x, y, [edges, edges])[0]
    mean = np.divide(total, muons, out=np.full_like(total, np.nan), where=muons > 0)
    mesh = axes.pcolormesh(edges, edges, mean.T, cmap="viridis")
    axes.figure.colorbar(mesh, ax=axes, label="mean scattering angle, at most 150 mrad each")
    phi = np.linspace(0, 2 * np.pi, 100)
    axes.plot(RADIUS * np.cos(phi), RADIUS * np.sin(phi), color="white", linestyle=":")
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")


if __name__ == "__main__":
    main()
