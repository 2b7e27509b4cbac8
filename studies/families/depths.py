"""The scores, rates and mean energies of a family against depth, from its evaluations.

python -m studies.families.depths EVALUATIONS FAMILY

EVALUATIONS is a folder of them, DEPTHm.json and DEPTHm-sphere.json, as models/make_family.py leaves it; FAMILY the ONNX
file. Rate and mean energy are asked of the family where it is scored and at 100 depths, of the same latents at each;
second differences in s = ln(density z + 0.7 m), the coordinate in which it interpolates, would show a kink as a peak.
Writes FAMILY.json, FAMILY.md and FAMILY.png beside itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray
from onnxruntime import InferenceSession

from deepmuon_runtime.latents.philox import latents
from deepmuon_runtime.model.family import at_depth, read_model
from deepmuon_runtime.model.metadata import Model
from deepmuon_training.families.knots import OFFSET
from deepmuon_training.reports.pictures import STYLE
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.histograms import compare_horizon
from deepmuon_training.underground.overburden import OVERBURDENS
from studies.shared.report import COLOURS, write

SEED = 1
DEPTHS = 100
WANTED = {"cry": (0.8, 1.2), "measured": (1.0, 1.5)}
"""Largest delta [%] of each flux, at knots and between."""

Float = NDArray[np.float64]


@click.command(help=__doc__)
@click.argument("evaluations", type=click.Path(exists=True, path_type=Path))
@click.argument("family", type=click.Path(exists=True, path_type=Path))
@click.option("--knots", required=True, help="Depths [m] of the knots, with commas between them.")
@click.option("-n", "--number", default=1_000_000, show_default=True, help="Muons for a mean energy.")
def main(evaluations: Path, family: Path, knots: str, number: int) -> None:
    """Read, sample, write."""
    known = {float(knot) for knot in knots.split(",")}
    scored = [Scored.read(path, known) for path in evaluations.glob("*m*.json")]
    scored.sort(key=lambda one: (one.surface, one.depth_m))
    contents = family.read_bytes()
    model = read_model(contents, str(family))
    density = OVERBURDENS[model.medium].density
    latent = latents(seed=SEED, first=0, draws=number, latent_size=model.latent_size)
    curve = smoothness(contents, model, density, latent)
    rows = [one.row(Known.of(contents, one.depth_m, latent) if one.surface == 0 else None) for one in scored]
    numbers = {"family": family.name, "scores": [vars(one) for one in scored], "muons": number, "curve": curve}
    figure = draw(scored, curve, density, WANTED[str(model.flux)])
    write(Path(__file__).with_name(f"{family.stem}.py"), numbers, [HEAD, *rows], figure)


HEAD = (
    *("depth / m", "", "through a", "delta / %", "KS energy", "KS cos zenith", "charge", "below cos 0.05"),
    *("rate over held out", "rate / (1/m² s)", "mean energy / GeV"),
)


class Known(NamedTuple):
    """What a family says of a depth, and what its muons there show."""

    rate: float
    mean_energy: float
    mean_ln_energy: float

    @classmethod
    def of(cls, contents: bytes, depth: float, latent: NDArray[np.float32]) -> Known:
        """Ask a family, of so many latents."""
        session = InferenceSession(at_depth(contents, depth), providers=["CPUExecutionProvider"])
        energy, rate = session.run(["kinetic_energy", "rate_hz_per_m2"], {"latent": latent})
        return cls(float(rate[0]), *(float(np.mean(one, dtype=np.float64)) for one in (energy, np.log(energy))))


@dataclass(frozen=True)
class Scored:
    """The scores at one depth."""

    depth_m: float
    knot: bool
    surface: int
    delta: float
    delta_noise: float
    ks_energy: float
    """Less what alike samples show on average."""
    ks_cos_zenith: float
    charge: float
    horizon: float | None
    rate: float | None
    """Over that of the held-out muons."""

    @classmethod
    def read(cls, path: Path, knots: set[float]) -> Scored:
        """Read an evaluation; its name says the depth."""
        found = Evaluation.from_json(path.read_text(encoding="utf-8"))
        depth = float(path.stem.partition("-")[0].removesuffix("m"))
        generated, held_out = (one.by_cos_zenith for one in (found.generated_spectra, found.held_out_spectra))
        flattest = compare_horizon(generated, held_out, found.variance_factor)[0]
        return cls(
            depth,
            depth in knots,
            found.surface,
            100 * found.cells.delta,
            100 * found.cells.delta_noise,
            *(found.ks[name].distance - found.ks[name].mean_noise for name in ("energy", "cos zenith")),
            found.charge.per_ndf or float("nan"),
            flattest.found / flattest.expected if flattest.expected else None,
            found.rate.generated / found.rate.held_out if found.rate else None,
        )

    def row(self, known: Known | None) -> list[str]:
        """Return its row of the table."""
        return [
            f"{self.depth_m:g}",
            "knot" if self.knot else "between",
            ("plane", "sphere")[self.surface],
            f"{self.delta:.2f} ± {self.delta_noise:.2f}",
            f"{self.ks_energy:+.4f}",
            f"{self.ks_cos_zenith:+.4f}",
            f"{self.charge:.2f}",
            "" if self.horizon is None else f"{self.horizon:.2f}",
            "" if self.rate is None else f"{self.rate:.4f}",
            *(("", "") if known is None else (f"{known.rate:.4g}", f"{known.mean_energy:.3g}")),
        ]


def smoothness(contents: bytes, model: Model, density: float, latent: NDArray[np.float32]) -> dict[str, Any]:
    """Find rate and mean energy at many depths, and second differences, of the same latents at each."""
    assert model.depth_min_m is not None
    assert model.depth_max_m is not None
    s = np.linspace(*(np.log(density * depth + OFFSET) for depth in (model.depth_min_m, model.depth_max_m)), DEPTHS)
    depths = np.clip((np.exp(s) - OFFSET) / density, model.depth_min_m, model.depth_max_m)
    found = [Known.of(contents, depth, latent) for depth in depths.tolist()]
    rate, energy = np.log([one.rate for one in found]), [one.mean_ln_energy for one in found]
    step = s[1] - s[0]
    return {
        "depth_m": depths.tolist(),
        "mean_energy": [one.mean_energy for one in found],
        "mean_ln_energy": energy,
        "ln_rate": rate.tolist(),
        "second_difference_of_ln_rate": (np.diff(rate, 2) / step**2).tolist(),
        "second_difference_of_mean_ln_energy": (np.diff(energy, 2) / step**2).tolist(),
    }


def draw(scored: list[Scored], curve: dict[str, Any], density: float, wanted: tuple[float, float]) -> Figure:
    """Draw delta, rate and mean energy, and second differences, against depth."""
    with rc_context(STYLE):
        figure = Figure(figsize=(7, 9), layout="constrained")
        delta, rate, second = figure.subplots(3, 1, sharex=True)
        for surface, marker in ((0, "o"), (1, "^")):
            for knot, colour in ((True, COLOURS[0]), (False, COLOURS[1])):
                some = [one for one in scored if (one.surface, one.knot) == (surface, knot)]
                name = f"{'at knots' if knot else 'between'}, {('plane', 'sphere')[surface]}"
                places, values = [density * one.depth_m + OFFSET for one in some], [one.delta for one in some]
                delta.errorbar(places, values, [one.delta_noise for one in some], fmt=marker, color=colour, label=name)
        for limit, colour in zip(wanted, COLOURS, strict=False):
            delta.axhline(limit, color=colour, ls=":")
        delta.set(ylabel="δ / %", ylim=(0, None))
        delta.legend(frameon=False, ncols=2, loc="upper left")
        places = density * np.array(curve["depth_m"]) + OFFSET
        rate.plot(places, np.exp(curve["ln_rate"]), color=COLOURS[0], label="rate / (1/m² s)")
        rate.plot(places, curve["mean_energy"], color=COLOURS[1], label="mean energy / GeV")
        rate.plot(places, np.exp(curve["mean_ln_energy"]), color=COLOURS[2], label="exp(mean of ln E/GeV)")
        rate.set(yscale="log")
        rate.legend(frameon=False)
        second.plot(places[1:-1], curve["second_difference_of_ln_rate"], color=COLOURS[0], label="of ln rate")
        second.plot(places[1:-1], curve["second_difference_of_mean_ln_energy"], color=COLOURS[2], label="of mean ln E")
        second.set(xscale="log", xlabel="depth + 0.7 / m w.e.", ylabel="second derivative in its logarithm")
        second.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
