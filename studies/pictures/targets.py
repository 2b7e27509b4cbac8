"""Where muons enter a tank, a panel and an upright wall, and how many do, beside the analytic numbers.

``python -m studies.pictures.targets [FAMILY.onnx]`` draws targets.png and writes the table targets.md, of the released
family or of another; the table has scenes too that are not drawn. The analytic number of a face is made of the muons
of a horizontal plane, which know nothing of bodies: a m2 that looks up takes each of them once, an upright one that
faces n by abs(d n) / cos zenith.
"""

from __future__ import annotations

import math
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime import Box, Cuts, Cylinder, Generator, Muons
from deepmuon_runtime.cuts import NO_CUTS
from studies.shared.report import write

PLANE_MUONS = 4_000_000
SHOWN = 1500
SEED = 1

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """A target, muons on it, and how large its faces are."""

    name: str
    target: Box | Cylinder
    depth: float  # m of water
    live_time: float  # s
    up: float  # m2, of its top
    side: float  # m2, half of that of its sides: an upright plane of so much has their muons, taken from both sides
    cuts: Cuts = NO_CUTS
    drawn: bool = True


SCENES = (
    Scene("tank", Cylinder(1.9, 3.6), 10, 300, math.pi * 1.9**2, math.pi * 1.9 * 3.6),
    Scene("panel", Box(1, 1, 0.02), 10, 3600, 1, 2 * 0.02),
    Scene("panel, above 1 GeV", Box(1, 1, 0.02), 10, 3600, 1, 2 * 0.02, Cuts(energy_min=1), drawn=False),
    Scene("panel, upright", Box(1, 0.02, 1), 10, 3600, 0.02, 1.02, drawn=False),
    Scene("wall", Box(1, 0.02, 1), 0, 3600, 0.02, 1.02, Cuts(zenith_min=60)),
    Scene("wall, all angles", Box(1, 0.02, 1), 0, 3600, 0.02, 1.02, drawn=False),
)


def main(file: str | None = None) -> None:
    """Draw all scenes, and write how many muons come."""
    figure = Figure(figsize=(8, 2.9), layout="constrained")
    rows = [("target", "entered by", "muons", "a second", "analytic")]
    numbers = {}
    pictures = iter(figure.subplots(1, sum(scene.drawn for scene in SCENES)))
    for scene in SCENES:
        generator = Generator.open(scene.depth, file=file)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the tank stands in a hall, where all of it is at one depth
            muons = generator.sample(seed=SEED, live_time=scene.live_time, target=scene.target, cuts=scene.cuts)
            rate = generator.rate(target=scene.target, cuts=scene.cuts)
        assert rate is not None
        up, side = per_square_metre(generator, scene.cuts)
        on_top = muons.z > scene.target.vertical_size / 2 * (1 - 1e-6)
        faces = {
            "top": (int(on_top.sum()), up * scene.up),
            "sides": (int((~on_top).sum()), side * scene.side),
            "all": (len(muons), up * scene.up + side * scene.side),
        }
        for face, (count, analytic) in faces.items():
            found = f"{count / scene.live_time:,.2f} ± {math.sqrt(count) / scene.live_time:.2g}"
            rows.append((scene.name, face, f"{count:,}", found, f"{analytic:,.2f}"))
        numbers[scene.name] = {"depth_m": scene.depth, "live_time_s": scene.live_time, "rate_hz": rate.hz, **faces}
        if scene.drawn:
            axes = next(pictures)
            draw(axes, muons)
            axes.set_title(f"{scene.name}: {rate.hz:,.1f} a second", fontsize=10)
    figure.colorbar(axes.collections[0], ax=figure.axes, label="zenith angle / °", aspect=30)
    write(Path(__file__), numbers, rows, figure)


def per_square_metre(generator: Generator, cuts: Cuts) -> tuple[float, float]:
    """Return the muons a second of a m2 that looks up, and of an upright one from both sides."""
    muons = generator.sample(PLANE_MUONS, seed=SEED + 1)
    rate = generator.model.rate_hz_per_m2
    assert rate is not None
    kept = cuts.keeps(muons)
    across = np.hypot(muons.u, muons.v, dtype=np.float64) * 2 / math.pi  # mean abs(d n) over the azimuth
    return rate * float(np.mean(kept)), rate * float(np.mean(kept * across / muons.cos_zenith))


def draw(axes: Axes, muons: Muons) -> None:
    """Draw places as seen from the front and above, each in the colour of its zenith angle."""
    some = muons[:SHOWN]
    x, y, z = (np.asarray(place, np.float64) for place in (some.x, some.y, some.z))
    zenith = np.degrees(np.arctan2(np.hypot(some.u, some.v), some.cos_zenith))
    turn, tilt = math.radians(30), math.radians(25)
    across, away = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)
    height = z * math.cos(tilt) + away * math.sin(tilt)
    order = np.argsort(-away)  # the near ones last
    axes.scatter(across[order], height[order], c=zenith[order], s=3, linewidth=0, vmin=0, vmax=90, cmap="viridis")
    axes.set(aspect="equal")
    axes.axis("off")


if __name__ == "__main__":
    main(*sys.argv[1:])
