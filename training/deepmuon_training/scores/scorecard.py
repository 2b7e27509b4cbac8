"""The scores in short: each with what alike samples show, and with its target where it has one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from math import hypot
from typing import Literal

from deepmuon_training.scores.chi_square import ChiSquare
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.independence import Independence

__all__ = ["TABLE_HEAD", "TARGETS", "Score", "Target", "judge", "markdown_scorecard", "scorecard", "table_rows"]

_KS_SPREAD = 0.26 / 0.87  # standard deviation over mean of Kolmogorov's distribution


TABLE_HEAD = ("score", "measured", "alike samples", "sigma", "target", "verdict")


@dataclass(frozen=True)
class Score:
    """One line of the scorecard.

    Parameters
    ----------
    name : str
    value : float or None
        What was measured; None where it is not defined.
    expected, noise : float or None
        Mean and standard deviation of the value for two alike samples of these sizes.
    sigma : float or None
        The value as a standard normal deviate, where its noise is one.
    excess : float or None
        How far the value is beyond noise: the 1 % level of a KS distance, 3 sigma of a count.
    target : str or None
        What was asked, in words.
    met : bool or None
        Whether it is so; None without a target or a value.
    """

    name: str
    value: float | None
    expected: float | None = None
    noise: float | None = None
    sigma: float | None = None
    excess: float | None = None
    target: str | None = None
    met: bool | None = None


@dataclass(frozen=True)
class Target:
    """Scores whose name matches a shell-style pattern shall have a value, excess or absolute sigma up to a limit."""

    scores: str
    of: Literal["value", "excess", "sigma"]
    limit: float


TARGETS: dict[str, tuple[Target, ...]] = {
    "quantile": (
        Target("KS *", "excess", 0.001),
        Target("cells*: delta", "value", 0.012),
        Target("energy bin*", "excess", 0.015),
        Target("tail *", "excess", 0.05),
        Target("charge by cell*", "value", 1.5),
        Target("classifier*", "value", 0.503),
        Target("independence:*", "sigma", 4.0),
        Target("repeated muons", "value", 0.0),
        Target("repeated energies*", "value", 12.0),  # see independence.Repeats
        Target("unphysical muons", "value", 0.0),
    ),
    "transformer": (Target("KS energy", "value", 0.006),),
}
"""What is asked of a released generator, by architecture. A missed target is reported, and raises nothing."""


def scorecard(evaluation: Evaluation, architecture: str | None = None) -> tuple[Score, ...]:
    """List the scores of an evaluation in short, judged; of many alike (bins, lags, blocks) the worst."""
    return judge(_scores(evaluation), architecture)


def judge(scores: Iterable[Score], architecture: str | None) -> tuple[Score, ...]:
    """Judge scores by the targets of an architecture; those it has none for stay as they are."""
    targets = TARGETS.get(architecture or "", ())
    return tuple(
        next((_judged(score, target) for target in targets if fnmatchcase(score.name, target.scores)), score)
        for score in scores
    )


def markdown_scorecard(evaluation: Evaluation, architecture: str | None = None) -> str:
    """Write the scores in short as a Markdown table: value, noise, limit, verdict."""
    rows = [
        [cell.replace("|", "\\|") for cell in row]
        for row in (TABLE_HEAD, *table_rows(scorecard(evaluation, architecture)))
    ]
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|---" * len(TABLE_HEAD) + "|", *lines[1:]]) + "\n"


def table_rows(scores: Iterable[Score]) -> list[tuple[str, ...]]:
    """Write each score in the words of `TABLE_HEAD`."""
    return [
        (score.name, _number(score.value), _alike(score), _sigma(score), score.target or "", _verdict(score))
        for score in scores
    ]


def _scores(evaluation: Evaluation) -> Iterator[Score]:
    for column, ks in evaluation.ks.items():
        yield Score(f"KS {column}", ks.distance, ks.mean_noise, _KS_SPREAD * ks.mean_noise, excess=ks.excess)
    for name, cells in (("cells", evaluation.cells), ("cells against raw", evaluation.cells_against_raw)):
        if cells is not None:
            yield _chi_square_score(f"{name}: chi2/ndf", cells.chi_square)
            yield Score(f"{name}: delta", cells.delta, 0.0, cells.delta_noise)
    for quantity, unit, bins in (
        ("energy", "GeV", evaluation.energy_bins),
        ("zenith", "degrees", evaluation.zenith_bins),
    ):
        if bins:
            worst = max(bins, key=lambda a: abs(a.pull))
            excess = max(abs(a.deviation) - 3 * a.error for a in bins)
            name = f"{quantity} bin, worst of {len(bins)} ({worst.low:.3g} to {worst.high:.3g} {unit})"
            yield Score(name, worst.deviation, 0.0, worst.error, worst.pull, excess)
    for tail in evaluation.tails:
        if tail.expected > 0:
            ratio, error = tail.found / tail.expected, tail.error / tail.expected
            yield Score(f"tail {tail.name}", ratio, 1.0, error, tail.pull, abs(ratio - 1) - 3 * error)
    yield _chi_square_score("charge by cell: chi2/ndf", evaluation.charge)
    charges = evaluation.charge_ratio
    noise = _quadrature(charges.generated_error, charges.held_out_error)
    yield Score("charge ratio", charges.generated, charges.held_out, noise, charges.sigma)
    yield _chi_square_score("azimuth: chi2/ndf", evaluation.azimuth.chi_square)
    auc, auc_noise = evaluation.classifier.auc, evaluation.classifier.noise
    yield Score("classifier: AUC", auc, 0.5, auc_noise, (auc - 0.5) / auc_noise)
    yield from _independence_scores(evaluation.independence)
    if evaluation.rate is not None:
        rate = evaluation.rate
        noise = _quadrature(rate.generated_error, rate.held_out_error)
        yield Score("rate (Hz/m2)", rate.generated, rate.held_out, noise, rate.sigma)
    yield Score("unphysical muons", evaluation.unphysical.fraction, 0.0)
    if evaluation.unphysical.fraction_before_mapping is not None:
        yield Score("unphysical before mapping", evaluation.unphysical.fraction_before_mapping, 0.0)


def _independence_scores(independence: Independence) -> Iterator[Score]:
    period = f"{independence.period} {'nominal ' if independence.period_is_nominal else ''}positions"
    yield _chi_square_score(f"independence: {period}, chi2/ndf", independence.positions)
    for share in independence.variance_between_positions:
        name = f"independence: variance of {share.column} between positions"
        yield Score(name, share.share, share.expected, share.noise, share.sigma)
    for column in dict.fromkeys(a.column for a in independence.autocorrelations):
        lags = [a for a in independence.autocorrelations if a.column == column]
        lag = max(lags, key=lambda a: abs(a.sigma))
        name = f"independence: autocorrelation of {column}, worst of {len(lags)} lags ({lag.lag})"
        yield Score(name, lag.correlation, 0.0, lag.noise, lag.sigma)
    for block in independence.block_means:
        name = f"independence: variance of means of {block.length}, {block.column}"
        yield Score(name, block.ratio, 1.0, block.noise, block.sigma)
    repeats = independence.repeats
    yield Score("repeated muons", repeats.muons, 0.0)
    noise = repeats.energies_noise / max(repeats.energies_expected, 1.0)
    yield Score("repeated energies, of those float32 explains", repeats.energies_ratio, 1.0, noise)


def _quadrature(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else hypot(a, b)


def _chi_square_score(name: str, chi_square: ChiSquare) -> Score:
    return Score(name, chi_square.per_ndf, 1.0, chi_square.per_ndf_noise, chi_square.sigma)


def _judged(score: Score, target: Target) -> Score:
    quantity = {"value": score.value, "excess": score.excess, "sigma": score.sigma and abs(score.sigma)}[target.of]
    words = {"value": "", "excess": "excess ", "sigma": "|sigma| "}[target.of] + f"≤ {target.limit:g}"
    return replace(score, target=words, met=None if quantity is None else quantity <= target.limit)


def _number(value: float | None) -> str:
    return "undefined" if value is None else format(value, ".4g")


def _alike(score: Score) -> str:
    if score.expected is None:
        return ""
    return _number(score.expected) + ("" if score.noise is None else f" ± {score.noise:.2g}")


def _sigma(score: Score) -> str:
    return "" if score.sigma is None else format(score.sigma, "+.1f")


def _verdict(score: Score) -> str:
    if score.target is None:
        return ""
    return {True: "met", False: "missed", None: "not measured"}[score.met]
