"""Muons at a depth by mulder, backward, beside those by Geant4, forward, from the flux `measured` both.

    python -m studies.great_depth.engines --work work

Rates, mean energies, spectra and zenith angles under 10, 50, 100 and 300 m of water, and what mulder's two modes
differ in, of which one lets muons scatter. Geant4's muons lie in the work folder and are not made again. Writes
engines.md, engines.json and engines.png beside itself. Ten minutes of Geant4 and ten of mulder, in core time;
`--more 10` takes ten times the muons of Geant4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY
from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.plane import plane_rate
from deepmuon_training.fluxes.sampler import PlaneSampler
from deepmuon_training.pipeline.step import Step, run_steps
from deepmuon_training.reports.pictures import STYLE
from deepmuon_training.sample import Sample, read_sample, write_sample
from deepmuon_training.transport.slab_file import transport_file
from deepmuon_training.underground.integration import Integral, plane_integral
from deepmuon_training.underground.mulder_carrier import DISCRETE, MIXED
from deepmuon_training.underground.overburden import overburden
from deepmuon_training.underground.place import place
from deepmuon_training.underground.workers import Workers
from studies.shared.report import COLOURS, write

PRIMARIES = {10: 500_000, 50: 260_000, 100: 130_000, 300: 40_000}
"""Muons at sea level by depth [m], all of which have E |w| above `CUT` a metre."""

CUT = 0.17
"""E |w| [GeV] per metre that a muon needs at least to arrive: it loses 0.18 and more."""

PRECISION = 5e-4
SEED = 15

ENERGIES = np.array([1e-3, 0.1, 0.3, 1, 3, 10, 30, 100, 300, 1e5])
COSINES = np.array([0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1])

Float = NDArray[np.float64]


class Compared(NamedTuple):
    """Muons of a depth by both engines."""

    depth: int
    sample: Sample
    by: dict[str, Integral]
    """By mulder, in each mode."""


@click.command(help=__doc__)
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Folder for Geant4's muons.")
@click.option("--more", default=1.0, show_default=True, help="Factor of Geant4's muons.")
def main(work: Path, more: float) -> None:
    """Make Geant4's muons where they are not there, integrate by mulder, and compare."""
    work.mkdir(parents=True, exist_ok=True)
    steps = [step for depth, number in PRIMARIES.items() for step in geant4_steps(work, depth, round(more * number))]
    run_steps(steps, click.echo)
    with Workers(overburden("water"), 2) as workers:
        found = [
            Compared(depth, read_sample(below(work, depth)), {mode: by_mulder(depth, mode, workers) for mode in MODES})
            for depth in PRIMARIES
        ]
    numbers, rows = compared(found)
    write(Path(__file__), numbers, rows, draw(found))


MODES = (DISCRETE, MIXED)


def below(work: Path, depth: int) -> Path:
    """Where Geant4's muons of a depth lie."""
    return work / f"geant4-{depth}m.h5"


def geant4_steps(work: Path, depth: int, number: int) -> Iterator[Step]:
    """Yield the steps that make Geant4's muons of a depth."""
    surface, deep = work / f"surface-{depth}m.h5", below(work, depth)

    def carry(folder: Path, progress: bool) -> None:
        transport_file(surface, deep, depth, seed=SEED, muons_per_part=20_000, folder=folder, progress=progress)

    yield Step("source", f"{number:,} muons", surface, lambda *_: write_sample(surface, above(depth, number)))
    yield Step("transport", f"to {depth} m", deep, carry)


def above(depth: int, number: int) -> Sample:
    """Return muons of the flux at sea level that may come so deep, and their rate."""
    least = max(CUT * depth, LOWEST_ENERGY)
    drawn = PlaneSampler(MEASURED, least, HIGHEST_ENERGY).draw(number, SEED)
    kept = drawn.kinetic_energy * drawn.cos_zenith >= least
    share = float(kept.mean())
    rate = plane_rate(MEASURED, least, HIGHEST_ENERGY)
    return Sample(
        drawn[kept],
        depth_m=0.0,
        source=MEASURED.origin,
        provenance=(f"{number} muons drawn, those with E |w| of {least:g} GeV and more kept, seed {SEED}",),
        rate=rate * share,
        rate_uncertainty=rate * float(np.sqrt(share * (1 - share) / number)),
        flux=MEASURED.name,
    )


def by_mulder(depth: int, mode: str, workers: Workers) -> Integral:
    """Integrate over the muons of a depth."""
    at = place(MEASURED, overburden("water"), depth).in_mode(mode)
    return plane_integral(at, workers, seed=SEED, precision=PRECISION)


def compared(found: list[Compared]) -> tuple[dict[str, object], list[tuple[str, ...]]]:
    """Return all numbers, and the rows of the table."""
    head = (
        "depth, mode",
        "rate, mulder",
        "rate, Geant4",
        "mulder / Geant4 - 1",
        "mean energy, same",
        "KS E",
        "KS cos θ",
    )
    rows: list[tuple[str, ...]] = [(*head, "5 % of KS exceed")]
    numbers: dict[str, object] = {}
    for depth, sample, by in found:
        assert sample.rate is not None
        assert sample.rate_uncertainty is not None
        energy, cosine = (np.asarray(x, float) for x in (sample.muons.kinetic_energy, sample.muons.cos_zenith))
        for mode, mulder in by.items():
            ratio = mulder.value / sample.rate - 1
            error = np.hypot(mulder.error / mulder.value, sample.rate_uncertainty / sample.rate)
            mean = mulder.mean_energy / energy.mean() - 1
            mean_error = energy.std() / energy.mean() / np.sqrt(len(energy))
            distances = [
                distance(of, trials, mulder.weights)
                for of, trials in ((energy, mulder.trials.energy), (cosine, mulder.trials.cos_zenith))
            ]
            weights = mulder.weights
            effective = weights.sum() ** 2 / (weights @ weights)
            limit = 1.358 * np.sqrt(1 / len(energy) + 1 / effective)
            rows.append(
                (
                    f"{depth} m, {mode}",
                    f"{mulder.value:.5g} ± {mulder.error:.1g}",
                    f"{sample.rate:.5g} ± {sample.rate_uncertainty:.1g}",
                    f"{ratio:+.2%} ± {error:.2%}",
                    f"{mean:+.2%} ± {mean_error:.2%}",
                    *(f"{one:.4f}" for one in distances),
                    f"{limit:.4f}",
                )
            )
            numbers[f"{depth} m, {mode}"] = {
                "rate": mulder.value,
                "rate_error": mulder.error,
                "geant4_rate": sample.rate,
                "geant4_rate_error": sample.rate_uncertainty,
                "geant4_muons": len(sample),
                "mean_energy": mulder.mean_energy,
                "geant4_mean_energy": float(energy.mean()),
                "ks_energy": distances[0],
                "ks_cos_zenith": distances[1],
                "ks_limit": float(limit),
                "by_energy": in_bins(mulder, sample, energies_of, ENERGIES).tolist(),
                "by_cos_zenith": in_bins(mulder, sample, cosines_of, COSINES).tolist(),
                "by_cos_zenith_below_1_gev": in_bins(mulder, sample, cosines_of, COSINES, 1.0).tolist(),
            }
    return numbers, rows


def distance(muons: Float, trials: Float, weights: Float) -> float:
    """Return the largest difference between the distribution of muons and that of weighted trials (KS)."""
    order = np.argsort(trials)
    cumulative = np.cumsum(weights[order]) / weights.sum()
    ranks = (np.arange(len(muons)) + 0.5) / len(muons)
    return float(np.abs(np.interp(np.sort(muons), trials[order], cumulative) - ranks).max())


def energies_of(energy: Float, cosine: Float) -> Float:
    """Return the first."""
    return energy


def cosines_of(energy: Float, cosine: Float) -> Float:
    """Return the second."""
    return cosine


def in_bins(
    mulder: Integral, sample: Sample, of: Callable[[Float, Float], Float], edges: Float, highest: float = np.inf
) -> Float:
    """Return mulder / Geant4 - 1 in each bin, and its statistical error, of muons below an energy [GeV]; [bin, 2]."""
    assert sample.rate is not None
    energy, cosine = (np.asarray(x, float) for x in (sample.muons.kinetic_energy, sample.muons.cos_zenith))
    slow = mulder.trials.energy < highest
    trials, weights = of(mulder.trials.energy, mulder.trials.cos_zenith)[slow], mulder.weights[slow]
    counts = np.histogram(of(energy, cosine)[energy < highest], edges)[0]
    sums, squares = (np.histogram(trials, edges, weights=weights**power)[0] for power in (1, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = sums / len(mulder.weights) / (counts * sample.rate / len(sample))
        return np.stack([ratio - 1, ratio * np.sqrt(squares / sums**2 + 1 / counts)], axis=1)


def draw(found: list[Compared]) -> Figure:
    """Draw mulder over Geant4: energies, zenith angles, and those of slow muons, in both modes."""
    with rc_context(STYLE):
        figure = Figure(figsize=(9, 2.2 * len(found)), layout="constrained")
        grid = figure.subplots(len(found), 3, squeeze=False, sharex="col")
        for row, one in zip(grid, found, strict=True):
            for mode, colour in zip(MODES, COLOURS, strict=False):
                mulder = one.by[mode]
                _draw_ratio(row[0], ENERGIES, in_bins(mulder, one.sample, energies_of, ENERGIES), colour, mode)
                _draw_ratio(row[1], COSINES, in_bins(mulder, one.sample, cosines_of, COSINES), colour, mode)
                _draw_ratio(row[2], COSINES, in_bins(mulder, one.sample, cosines_of, COSINES, 1.0), colour, mode)
            row[0].set(ylabel=f"{one.depth} m: mulder / Geant4", xscale="log", xlim=(0.01, 1000))
        grid[0, 0].legend()
        for axes, label in zip(
            grid[-1], ("kinetic energy [GeV]", "cos zenith", "cos zenith, below 1 GeV"), strict=True
        ):
            axes.set(xlabel=label)
    return figure


def _draw_ratio(axes: Axes, edges: Float, ratio: Float, colour: str, label: str) -> None:
    middle = np.sqrt(edges[1:] * edges[:-1]) if edges[0] else (edges[1:] + edges[:-1]) / 2
    shown = np.isfinite(ratio).all(axis=1) & (ratio[:, 1] < 0.2)
    axes.errorbar(middle[shown], 1 + ratio[shown, 0], ratio[shown, 1], fmt="o", ms=3, color=colour, label=label)
    axes.axhline(1, color="black", lw=0.6)
    axes.set(ylim=(0.8, 1.2))


if __name__ == "__main__":
    main()
