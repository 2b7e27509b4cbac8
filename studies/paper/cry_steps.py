"""The steps of CRY's tables: in its muons, in smoothed ones, and in generators trained on each.

    python -m studies.paper.cry_steps --cry cry_sea_level.h5 --more-cry cry_40M.h5 --work work

The first file trains (its last two million muons do not), the other one judges. How much of the steps a generator has
is found by regression: of its fine-binned spectrum on CRY's, both less the smoothed one, beside a polynomial for what
is slowly wrong. It is 0 for smoothed muons and 1 for CRY's own; likewise for the mean of cos zenith. Networks of the
paper's kind are also trained for less long, to see whether that keeps the steps out. Finished fits lie in the work
folder and are not repeated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
import torch
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from deepmuon_runtime import Generator, Muons
from deepmuon_training.data.cry import HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.data.smoothing import StepSmoother, smoothed
from deepmuon_training.generators.transformer.fit import TransformerSettings
from deepmuon_training.reports.pictures import STYLE
from deepmuon_training.scores.histograms import compare_cells, count_muons
from deepmuon_training.scores.kolmogorov_smirnov import kolmogorov_smirnov
from studies.shared.judged import GENERATED
from studies.shared.options import FILE
from studies.shared.report import COLOURS, write
from studies.shared.trained import SEED, trained

EDGES = 10.0 ** np.linspace(-0.6, 2.4, 151)
"""Ten bins to a cell of CRY's tables."""

SLOW = 5
"""Degree of the polynomial, over the logarithm of the energy; fifteen of CRY's cells lie in its range."""

STOPPED = (250, 500, 1000, 2000, 6000)
"""Steps after which training ends; the last one is that of the released models."""

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Profile:
    """Muons in fine bins of the energy: their fraction and its variance, the mean of cos zenith and its variance."""

    fraction: Float
    fraction_variance: Float
    cos_zenith: Float
    cos_zenith_variance: Float

    @classmethod
    def of(cls, muons: Muons) -> Profile:
        """Count the muons."""
        energy, cosine = muons.kinetic_energy.astype(np.float64), muons.cos_zenith.astype(np.float64)
        n = np.histogram(energy, EDGES)[0]
        mean = np.histogram(energy, EDGES, weights=cosine)[0] / n
        square = np.histogram(energy, EDGES, weights=cosine**2)[0] / n
        return cls(n / len(muons), n / len(muons) ** 2, mean, (square - mean**2) / n)


@click.command(help=__doc__)
@click.option("--cry", required=True, type=FILE, help="CRY's muons at sea level, of which the first train.")
@click.option("--more-cry", required=True, type=FILE, help="Those of another run of CRY, which judge.")
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Folder for the generators.")
def main(cry: Path, more_cry: Path, work: Path) -> None:
    """Fit the generators that are missing, then measure their steps."""
    torch.set_num_threads(1)
    training, held_out = read_cry(cry, slice(-HELD_OUT_CRY_MUONS)), read_cry(cry, slice(-HELD_OUT_CRY_MUONS, None))
    generators = {("quantile", "smoothed", None): Generator.open(0, architecture="quantile")}
    generators |= {("quantile", "raw", None): trained(training, "quantile", work / "quantile")}
    generators |= {("transformer", "smoothed", STOPPED[-1]): Generator.open(0, architecture="transformer")}
    for steps in STOPPED:
        stem = work / f"transformer-{steps}"
        generators["transformer", "raw", steps] = trained(training, "transformer", stem, stopped_after(steps))
    smooth = StepSmoother(training.muons)
    judge = Judge(read_cry(more_cry).muons, smooth)
    results = {
        ("CRY, held out", "raw", None): judge(held_out.muons),
        ("CRY, held out", "smoothed", None): judge(smoothed(held_out, smooth).muons),
        **{key: judge(generator.sample(GENERATED, seed=SEED)) for key, generator in generators.items()},
    }
    numbers = [
        dict(zip(("what", "trained_on", "steps"), key, strict=True)) | dict(r) for key, (r, _) in results.items()
    ]
    write(Path(__file__), {"generated": GENERATED, "results": numbers}, table(numbers), draw(judge, results))


def stopped_after(steps: int) -> TransformerSettings:
    """Return the settings of a shorter training, whose rate falls and whose averaging shortens with it."""
    settings = TransformerSettings()
    whole = settings.schedule
    averaging = 1 - (1 - whole.averaging) * whole.steps / steps
    return replace(settings, schedule=replace(whole, steps=steps, averaging=averaging))


class Judge:
    """Compares muons with many of CRY's, raw and smoothed."""

    def __init__(self, raw: Muons, smooth: StepSmoother) -> None:
        self.raw, self.smooth = raw, smooth(raw)
        self.raw_profile, self.smooth_profile = Profile.of(self.raw), Profile.of(self.smooth)
        self.raw_counts = count_muons(self.raw)

    def __call__(self, muons: Muons) -> tuple[dict[str, float], Profile]:
        """Return the scores of muons, and their profile."""
        profile = Profile.of(muons)
        energy, energy_error = self.steps(profile, "fraction")
        cosine, cosine_error = self.steps(profile, "cos_zenith")
        return {
            "energy_steps": energy,
            "energy_steps_error": energy_error,
            "zenith_steps": cosine,
            "zenith_steps_error": cosine_error,
            "ks_raw": kolmogorov_smirnov(muons.kinetic_energy, self.raw.kinetic_energy).distance,
            "ks_smoothed": kolmogorov_smirnov(muons.kinetic_energy, self.smooth.kinetic_energy).distance,
            "delta": compare_cells(count_muons(muons), self.raw_counts).delta,
        }, profile

    def steps(self, profile: Profile, name: str) -> tuple[float, float]:
        """How much of CRY's steps a profile has, and the standard error: weighted least squares."""
        values, smooth, raw = (getattr(of, name) for of in (profile, self.smooth_profile, self.raw_profile))
        slow = legvander(np.linspace(-1, 1, len(smooth)), SLOW) * smooth[:, None]
        columns = np.column_stack([raw - smooth, slow])
        sigma = np.sqrt(sum(getattr(of, f"{name}_variance") for of in (profile, self.smooth_profile)))
        weighted = columns / sigma[:, None]
        solution = np.linalg.lstsq(weighted, (values - smooth) / sigma)[0]
        return float(solution[0]), float(np.sqrt(np.linalg.inv(weighted.T @ weighted)[0, 0]))


def table(numbers: list[dict[str, float | str | None]]) -> list[tuple[str, ...]]:
    """One row for each set of muons."""
    head = ("muons of", "trained on", "training", "in energy", "in cos zenith", "KS to CRY", "to smoothed", "delta")
    rows: list[tuple[str, ...]] = [head]
    for of in numbers:
        rows.append(
            (
                str(of["what"]),
                str(of["trained_on"]),
                "" if of["steps"] is None else f"{of['steps']:,} steps",
                f"{of['energy_steps']:.3f} ± {of['energy_steps_error']:.3f}",
                f"{of['zenith_steps']:.3f} ± {of['zenith_steps_error']:.3f}",
                f"{of['ks_raw']:.4f}",
                f"{of['ks_smoothed']:.4f}",
                f"{of['delta']:.2%}",
            )
        )
    return rows


def draw(judge: Judge, results: dict[tuple[str, str, int | None], tuple[dict[str, float], Profile]]) -> Figure:
    """Draw the spectrum and the mean angle, and those of the generators relative to the smoothed ones."""
    kinds = (("quantile", None), ("transformer", STOPPED[-1]))
    colours = {"raw": COLOURS[1], "smoothed": COLOURS[0]}
    with rc_context(STYLE):
        figure = Figure(figsize=(10.5, 8.5), layout="constrained")
        grid = figure.subplots(3, 2)
        spectrum, angle = grid[0]
        width = np.diff(np.log10(EDGES))
        for axes, name, scale in ((spectrum, "fraction", 1 / width), (angle, "cos_zenith", 1.0)):
            stairs(axes, getattr(judge.raw_profile, name) * scale, "0.6", "CRY")
            stairs(axes, getattr(judge.smooth_profile, name) * scale, "black", "smoothed")
        spectrum.set(title="energy spectrum", ylabel="fraction of a decade", yscale="log")
        angle.set(title="mean of cos zenith")
        spectrum.legend()
        panels = [(kind, name) for kind in kinds for name in ("fraction", "cos_zenith")]
        for axes, ((what, steps), name) in zip(grid[1:].flat, panels, strict=True):
            smooth = getattr(judge.smooth_profile, name)
            stairs(axes, getattr(judge.raw_profile, name) / smooth, "0.6", "CRY")
            for on, colour in colours.items():
                profile = results[what, on, steps][1]
                stairs(axes, getattr(profile, name) / smooth, colour, f"trained on {on}")
            what_is = "spectrum" if name == "fraction" else "mean of cos zenith"
            axes.set(title=f"{what}: {what_is}, over the smoothed one")
            axes.set(ylim=(0.75, 1.25) if name == "fraction" else (0.97, 1.03))
        grid[1, 1].legend(fontsize="small", loc="lower left")
        for axes in grid[-1]:
            axes.set(xlabel="kinetic energy / GeV")
    return figure


def stairs(axes: Axes, values: Float, colour: str, label: str) -> None:
    """Draw values of the bins."""
    axes.stairs(values, EDGES, baseline=None, color=colour, label=label)
    axes.set(xscale="log")


if __name__ == "__main__":
    main()
