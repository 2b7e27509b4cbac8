"""The flux `measured`: its fit to BESS-TeV and L3+C, how good it is, its rates and their errors, and two pictures.

python -m studies.measured_flux.fit

Prints the parameters, which stand in deepmuon_training/fluxes/measured.py, and writes parameters.md, fit.md, rates.md,
fit.json, fit.png and shape.png beside itself. Half a minute.
"""

from __future__ import annotations

import json
from dataclasses import asdict, astuple, fields
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from deepmuon_training.fluxes.flux import Intensity
from deepmuon_training.fluxes.measured import Parameters, intensity
from deepmuon_training.fluxes.table import read_flux_table
from studies.measured_flux.data import Bess, read_bess, read_l3
from studies.measured_flux.draw import draw_fit, draw_shape
from studies.measured_flux.rates import rate_rows, rates
from studies.measured_flux.smoothness import smoothness
from studies.shared.report import table, write

START = Parameters(0.7, 2.65, 300.0, 3e-3, 0.55, 3.0, 4.0)

BIASES = ((0.5, 2.0, 0.02), (2.0, 10.0, 0.02), (10.0, 100.0, 0.02), (100.0, 500.0, 0.08))
"""Ranges of momentum [GeV/c], and by how much the fitted flux may be off there on average."""

RATIO_EDGES = (2.0, 5.0, 10.0, 20.0, 50.0, 91.0)
"""Groups of bins in momentum [GeV/c], in which the charge ratio is to be within 3 %."""

EXPONENT = [field.name for field in fields(Parameters)].index("exponent")

Float = NDArray[np.float64]


class Score(NamedTuple):
    """One thing that is asked of the flux."""

    what: str
    asked: str
    found: str
    kept: bool


def _within(limit: float) -> str:
    return f"within {100 * limit:g} %"


def _percent(off: float) -> str:
    return f"{100 * off:+.1f} %"


def of(parameters: Parameters) -> Intensity:
    """Return the flux with these parameters."""
    return lambda energy, cos_zenith: intensity(energy, cos_zenith, parameters)


class Fit(NamedTuple):
    """What a fit found."""

    parameters: Parameters
    """Rounded to the digits that are printed."""
    covariance: Float
    chi2: float
    numbers: int
    """How many measured ones it was fitted to."""
    exponent_error: float
    l3_level: float
    """What L3+C measured by what the flux has, where that factor was left free to find the exponent."""
    together: Parameters
    """The parameters if everything is fitted in one step."""
    together_chi2: float


def fit() -> Fit:
    """Fit BESS-TeV's two charges, L3+C's flux and L3+C's charge ratio, each over its total error, in two steps.

    The levels of the two experiments differ, which in one fit of everything would bend the exponent. So it is
    taken from a fit that leaves L3+C's level free, and the rest from one that takes the level as it was measured.
    """
    everything = _least_squares(np.array(astuple(START)))
    level_free = _least_squares(np.array([*astuple(START), 1.0]))
    exponent, error = level_free.x[EXPONENT], _covariance(level_free)[EXPONENT, EXPONENT] ** 0.5
    found, changed = (_least_squares(everything.x, value) for value in (exponent, exponent + error))
    values, per_error = found.x, changed.x - found.x
    fitted = np.delete(np.arange(len(values)), EXPONENT)
    covariance = np.outer(per_error, per_error)
    covariance[np.ix_(fitted, fitted)] += np.linalg.inv(found.jac[:, fitted].T @ found.jac[:, fitted])
    return Fit(
        _rounded(values),
        covariance,
        2 * found.cost,
        len(found.fun),
        error,
        level_free.x[-1],
        _rounded(everything.x),
        2 * everything.cost,
    )


def _least_squares(start: Float, exponent: float | None = None) -> Any:
    """Fit the parameters, and L3+C's level after them if there is one; the exponent stays as it is given."""
    bess, l3 = read_bess(), read_l3()

    def residuals(values: Float) -> Float:
        flux = of(Parameters(*values[: len(astuple(START))]))
        level = values[-1] if len(values) > len(astuple(START)) else 1.0
        l3_flux, l3_ratio = l3.predicted(flux)
        return np.concatenate(
            [
                ((bess.predicted(flux) - bess.flux) / bess.error).ravel(),
                (level * l3_flux - l3.flux) / l3.error,
                (l3_ratio - l3.ratio) / l3.ratio_error,
            ]
        )

    if exponent is None:
        return least_squares(residuals, start, x_scale=start, xtol=1e-12, ftol=1e-12, gtol=1e-12)

    def others(values: Float) -> Float:
        return residuals(np.insert(values, EXPONENT, exponent))

    rest = np.delete(start, EXPONENT)
    found = least_squares(others, rest, x_scale=rest, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    found.x = np.insert(found.x, EXPONENT, exponent)
    found.jac = np.insert(found.jac, EXPONENT, 0.0, axis=1)
    return found


def _covariance(found: Any) -> Float:
    return np.linalg.inv(found.jac.T @ found.jac)


def _rounded(values: Float) -> Parameters:
    return Parameters(*(float(f"{value:.5g}") for value in values))


def scores(flux: Intensity) -> list[Score]:
    """Compare a flux with what was measured."""
    bess, l3 = read_bess(), read_l3()
    expected = bess.predicted(flux)
    total, error = bess.flux.sum(axis=0), np.hypot(*bess.error)
    off = expected.sum(axis=0) / total - 1
    chi2 = float(np.mean(((expected.sum(axis=0) - total) / error) ** 2))
    found = [Score("BESS-TeV, 65 bins: chi2/n", "2 at most", f"{chi2:.2f}", chi2 <= 2)]
    for low, high, limit in BIASES:
        bias = float(off[(bess.mean >= low) & (bess.mean < high)].mean())
        found.append(
            Score(
                f"BESS-TeV, {low:g} to {high:g} GeV/c: mean bias",
                _within(limit),
                _percent(bias),
                bool(abs(bias) <= limit),
            )
        )
    l3_flux, l3_ratio = l3.predicted(flux)
    chi2 = float(np.mean(((l3_flux - l3.flux) / l3.error) ** 2))
    found.append(Score("L3+C, 14 bins: chi2/n", "6 at most", f"{chi2:.2f}", chi2 <= 6))
    return [*found, *charge_scores(bess, expected), _ratio_score("L3+C", l3_ratio, l3.ratio, l3.ratio_error)]


def charge_scores(bess: Bess, expected: Float) -> list[Score]:
    """Compare the charge ratio with BESS-TeV's."""
    ratio, model = bess.flux[0] / bess.flux[1], expected[0] / expected[1]
    error = ratio * np.hypot(*(bess.error / bess.flux))
    found = []
    for low, high in pairwise(RATIO_EDGES):
        group = (bess.mean >= low) & (bess.mean < high)
        measured, fitted = (np.average(of_bin[group], weights=error[group] ** -2) for of_bin in (ratio, model))
        off = fitted / measured - 1
        what = f"charge ratio, {low:g} to {high:g} GeV/c: {fitted:.3f} for {measured:.3f}"
        found.append(Score(what, _within(0.03), _percent(off), bool(abs(off) <= 0.03)))
    above = bess.mean >= RATIO_EDGES[-1]
    return [*found, _ratio_score("BESS-TeV above 91 GeV/c", model[above], ratio[above], error[above])]


def _ratio_score(whose: str, fitted: Float, measured: Float, error: Float) -> Score:
    chi2 = float(np.mean(((fitted - measured) / error) ** 2))
    return Score(f"charge ratio, {whose}, {len(measured)} bins: chi2/n", "1.5 at most", f"{chi2:.2f}", chi2 <= 1.5)


def shape_scores(flux: Intensity, other: Intensity, cosines: Float) -> list[Score]:
    """Compare the zenith angles with those of another flux, both relative to vertical muons."""
    found = []
    for low, high, limit in ((1.0, 1e4, 0.15), (0.3, 1.0, 0.3)):
        energy = np.geomspace(low, high, 200)[:, None]
        mine, others = (sum(one(energy, cosines)) / sum(one(energy, np.ones(1))) for one in (flux, other))
        off = mine / others - 1
        what = (
            f"zenith angles relative to the other flux's, cos zenith over {cosines.min():.2g}, {low:g} to {high:g} GeV"
        )
        found.append(
            Score(
                what, _within(limit), f"{_percent(off.min())} to {_percent(off.max())}", bool(abs(off).max() <= limit)
            )
        )
    return found


def parameter_rows(best: Fit) -> list[tuple[str, ...]]:
    """Return a table of the parameters: its head, and a row for each."""
    symbols = ("$A$", "$\\gamma$", "$X_p$ / (g/cm²)", "$a$ / (GeV cm²/g)", "$f_+$", "$B_0$ / GeV", "$k$")
    errors = np.sqrt(np.diag(best.covariance))
    values = zip(symbols, astuple(best.parameters), errors, strict=True)
    return [("fitted", "value", "error"), *((name, f"{value:.5g}", f"{error:.2g}") for name, value, error in values)]


@click.command(help=__doc__)
@click.option(
    "--compare",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="TABLE.csv",
    help="Another flux, to compare zenith angles and rates with.",
)
def main(compare: Path | None) -> None:
    """Fit, score, integrate, draw, write."""
    best = fit()
    parameters, covariance = best.parameters, best.covariance
    flux = of(parameters)
    click.echo("FITTED = Parameters(")
    for (name, value), variance in zip(asdict(parameters).items(), np.diag(covariance), strict=True):
        click.echo(f"    {name}={value:.5g},  # +- {variance**0.5:.2g}")
    click.echo(")")
    click.echo(f"chi2 {best.chi2:.1f} of {best.numbers} numbers; exponent +- {best.exponent_error:.4f}")
    click.echo(f"L3+C's level, where it was free: {best.l3_level:.4f}")
    click.echo(f"in one step: chi2 {best.together_chi2:.1f}, {best.together}")
    found = [*scores(flux), *(Score(*line) for line in smoothness(flux))]
    integrated = rates(parameters, covariance)
    numbers: dict[str, Any] = {
        "parameters": asdict(parameters),
        "errors": dict(zip(asdict(parameters), np.sqrt(np.diag(covariance)).tolist(), strict=True)),
        "chi2": best.chi2,
        "numbers": best.numbers,
        "l3_level": best.l3_level,
        "in_one_step": {"chi2": best.together_chi2, **asdict(best.together)},
        "scores": [score._asdict() for score in found],
        "rates": [rate._asdict() for rate in integrated],
    }
    here = Path(__file__)
    head = ("what", "asked", "found")
    write(here, numbers, [head, *((s.what, s.asked, s.found) for s in found)], draw_fit(flux))
    here.with_name("parameters.md").write_text(table(parameter_rows(best)), encoding="utf-8")
    here.with_name("rates.md").write_text(table(rate_rows(integrated)), encoding="utf-8")
    draw_shape(flux).savefig(here.with_name("shape.png"), dpi=110)
    if compare is not None:
        other = read_flux_table(compare)
        cosines = np.cos(np.radians([10, 20, 30, 40, 50, 60, 65, 70, 75, 80, 82, 84]))
        found += shape_scores(flux, other.intensity, cosines)
        for rate in rates(parameters, covariance, other.intensity):
            click.echo(f"above {rate.above_gev:g} GeV with the other flux's zenith angles: {rate.other_shape:.2f}")
    for score in found:
        click.echo(f"{'kept  ' if score.kept else 'MISSED'} {score.what}: {score.found} ({score.asked})")
    for rate in numbers["rates"]:
        click.echo(json.dumps({name: round(value, 3) for name, value in rate.items()}))


if __name__ == "__main__":
    main()
