"""Vertical intensities and totals deep in rock, from the flux `measured`, beside what was measured there.

    python -m studies.great_depth.depths

Everything is carried through standard rock by mulder. Writes depths.md, sites.md, depths.json and depths.png beside
itself. Five minutes on two cores.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.reports.pictures import STYLE
from deepmuon_training.underground.integration import Integral, plane_integral, vertical_integral
from deepmuon_training.underground.overburden import OVERBURDENS, Overburden
from deepmuon_training.underground.place import Place, place
from deepmuon_training.underground.workers import Workers
from studies.great_depth.measured import FITS, Intensity, Total, read_intensities, read_totals
from studies.shared.report import COLOURS, table, write

DEPTHS = (0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 6.6)
"""Of the line [km w.e.]."""

BAND = 0.1
"""By how much the flux may be too high above 1 TeV: L3+C's last two points are 1 and 14 % below the formula."""

SITES = {"WIPP": 1.54, "Soudan": 2.07, "Boulby": 2.83, "SUPL": 2.93, "Homestake, 4850 ft": 4.38, "SNOLAB": 6.13}
"""Laboratories under flat overburdens, and their depth in km w.e. of standard rock by arXiv:2406.10339."""

SEED = 15
PRECISION = 2e-3
ROCK = OVERBURDENS["rock"]

Float = NDArray[np.float64]


class Row(NamedTuple):
    """One comparison."""

    what: str
    depth: float
    ours: float
    our_error: float
    value: float
    error: float

    @property
    def ratio(self) -> float:
        """Ours by theirs."""
        return self.ours / self.value

    @property
    def ratio_error(self) -> float:
        """Its statistical error, and that of the measurement."""
        return self.ratio * float(np.hypot(self.our_error / self.ours, self.error / self.value))


@click.command(help=__doc__)
@click.option("--processes", default=2, show_default=True, help="Of mulder side by side.")
def main(processes: int) -> None:
    """Integrate at all depths, and write the line, the table and the picture."""
    with Workers(ROCK, processes) as workers:
        line = [vertical(depth, workers) for depth in DEPTHS]
        charges = [one.positive / (1 - one.positive) for one in line]
        energies = [one.mean_energy for one in line]
        rows = [*of_intensities(workers), *of_totals(workers), *of_fits(line)]
        sites = [of_site(name, depth, workers) for name, depth in SITES.items()]
    head = ("what, per cm² and s (and sr)", "depth, km w.e.", "ours", "measured", "ours / measured")
    compared = [
        (
            row.what,
            f"{row.depth:.4g}",
            f"{1e-4 * row.ours:.3g}",
            f"{1e-4 * row.value:.3g} ± {1e-4 * row.error:.1g}",
            f"{row.ratio:.3f} ± {row.ratio_error:.3f}",
        )
        for row in rows
    ]
    numbers = {
        "line": {
            "depth_kmwe": DEPTHS,
            "vertical_intensity_m2_s_sr": [one.value for one in line],
            "error": [one.error for one in line],
            "charge_ratio": charges,
            "mean_energy_gev": energies,
        },
        "compared": [row._asdict() | {"ratio": row.ratio, "ratio_error": row.ratio_error} for row in rows],
    }
    write(Path(__file__), numbers, [head, *compared], draw(line, rows))
    names = ("site", "depth, km w.e.", "horizontal plane", "across their way", "mean energy, GeV", "μ⁺/μ⁻")
    Path(__file__).with_name("sites.md").write_text(table([names, *sites]), encoding="utf-8")


def at(depth_kmwe: float, overburden: Overburden = ROCK) -> Place:
    """Return a depth [km w.e.]."""
    return place(MEASURED, overburden, 1e3 * depth_kmwe / overburden.density)


def vertical(depth_kmwe: float, workers: Workers) -> Integral:
    """Integrate the vertical intensity at a depth."""
    return vertical_integral(at(depth_kmwe), workers, seed=SEED, precision=PRECISION)


def of_intensities(workers: Workers) -> list[Row]:
    """Compare with measured vertical intensities."""
    return [_row(one, vertical(one.depth_kmwe, workers)) for one in read_intensities()]


def _row(one: Intensity, ours: Integral) -> Row:
    return Row(f"{one.site}, vertical", one.depth_kmwe, ours.value, ours.error, one.value, one.error)


def of_totals(workers: Workers) -> list[Row]:
    """Compare with measured totals, and say what a horizontal plane would see."""
    return [row for one in read_totals() for row in _total(one, workers)]


def _total(one: Total, workers: Workers) -> list[Row]:
    found = plane_integral(at(one.depth_kmwe), workers, seed=SEED, precision=PRECISION)
    wanted = found.trials.cos_zenith >= one.lowest_cosine
    names = {"across their way": found.weights / found.trials.cos_zenith, "horizontal plane": found.weights}
    return [
        Row(
            f"{one.site}, {name}",
            one.depth_kmwe,
            float((weights * wanted).mean()),
            float((weights * wanted).std() / np.sqrt(len(weights))),
            one.value,
            one.error,
        )
        for name, weights in names.items()
    ]


def of_site(name: str, depth_kmwe: float, workers: Workers) -> tuple[str, ...]:
    """Return the row of a laboratory: fluxes per cm2 and s, mean energy, charge ratio."""
    found = plane_integral(at(depth_kmwe), workers, seed=SEED, precision=PRECISION)
    across = float((found.weights / found.trials.cos_zenith).mean())
    ratio = found.positive / (1 - found.positive)
    fluxes = (f"{1e-4 * flux:.3g}" for flux in (found.value, across))
    return name, f"{depth_kmwe:g}", *fluxes, f"{found.mean_energy:.0f}", f"{ratio:.2f}"


def of_fits(line: list[Integral]) -> list[Row]:
    """Compare with fits to measurements at whole numbers of km w.e."""
    rows = []
    for fit in FITS:
        for depth, ours in zip(DEPTHS, line, strict=True):
            if fit.low <= depth <= fit.high and depth == round(depth):
                value, error = (float(x[0]) for x in fit(np.array([depth])))
                rows.append(Row(f"{fit.name}, fit", depth, ours.value, ours.error, value, error))
    return rows


def draw(line: list[Integral], rows: list[Row]) -> Figure:
    """Draw the intensity, and ours by measured."""
    depth, ours = np.array(DEPTHS), np.array([one.value for one in line])
    with rc_context(STYLE):
        figure = Figure(figsize=(7, 7.5), layout="constrained")
        above, below = figure.subplots(2, sharex=True, height_ratios=(3, 2))
        above.plot(depth, ours, color=COLOURS[0], label="ours: the flux measured, by mulder, in standard rock")
        above.fill_between(depth, (1 - BAND) * ours, ours, color=COLOURS[0], alpha=0.25, lw=0)
        below.fill_between(depth, 1 - BAND, 1, color=COLOURS[0], alpha=0.25, lw=0)
        below.axhline(1, color=COLOURS[0])
        for fit, colour in zip(FITS, (COLOURS[2], COLOURS[3]), strict=True):
            there = (depth >= fit.low) & (depth <= fit.high)
            value, error = fit(depth[there])
            above.plot(depth[there], value, "--", color=colour, label=f"{fit.name}, fit")
            below.plot(depth[there], value / ours[there], "--", color=colour)
            below.fill_between(
                depth[there],
                (value - error) / ours[there],
                (value + error) / ours[there],
                color=colour,
                alpha=0.2,
                lw=0,
            )
        sites = sorted({one.site for one in read_intensities()})
        for site, colour in zip(sites, (COLOURS[1], COLOURS[4], COLOURS[5]), strict=True):
            of = [row for row in rows if row.what == f"{site}, vertical"]
            places = [row.depth for row in of]
            above.errorbar(
                places, [row.value for row in of], [row.error for row in of], fmt="o", ms=4, color=colour, label=site
            )
            ratios = [(row.value / row.ours, row.error / row.ours) for row in of]
            below.errorbar(places, *zip(*ratios, strict=True), fmt="o", ms=4, color=colour)
        above.set(yscale="log", ylabel="vertical intensity [1/(m$^2$ s sr)]")
        above.legend()
        below.set(xlabel="depth [km w.e. of standard rock]", ylabel="measured / ours", ylim=(0.5, 1.6))
    return figure


if __name__ == "__main__":
    main()
