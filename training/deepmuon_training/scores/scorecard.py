"""The scores in short: each with what alike samples show, and with its target where it has one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import hypot

from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.histograms import Bin, TailScore, compare_cos_zenith, compare_horizon
from deepmuon_training.scores.independence import Independence
from deepmuon_training.scores.score import Score
from deepmuon_training.scores.targets import judge

__all__ = ["TABLE_HEAD", "markdown_scorecard", "scorecard", "table_rows"]

_KS_SPREAD = 0.26 / 0.87  # standard deviation over mean of Kolmogorov's distribution

TABLE_HEAD = ("score", "measured", "alike samples", "sigma", "excess", "target", "effective limit", "verdict")


def scorecard(evaluation: Evaluation, architecture: str | None = None) -> tuple[Score, ...]:
    """List the scores of an evaluation in short, judged; of many alike (bins, lags) the worst."""
    return judge(_scores(evaluation), architecture)


def markdown_scorecard(evaluation: Evaluation, architecture: str | None = None) -> str:
    """Write the scores in short as a Markdown table: value, noise, limits, verdict."""
    rows = [
        [cell.replace("|", "\\|") for cell in row]
        for row in (TABLE_HEAD, *table_rows(scorecard(evaluation, architecture)))
    ]
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|---" * len(TABLE_HEAD) + "|", *lines[1:]]) + "\n"


def table_rows(scores: Iterable[Score]) -> list[tuple[str, ...]]:
    """Write each score in the words of `TABLE_HEAD`."""
    return [
        (
            score.name,
            _number(score.value),
            _alike(score),
            "" if score.sigma is None else format(score.sigma, "+.1f"),
            "" if score.excess is None else format(score.excess, ".2g"),
            score.target or "",
            "" if score.effective_limit is None else f"± {score.effective_limit:.2g}",
            score.verdict or "",
        )
        for score in scores
    ]


def _scores(evaluation: Evaluation) -> Iterator[Score]:
    for column, ks in evaluation.ks.items():
        margin, spread = ks.one_percent_level, _KS_SPREAD * ks.mean_noise
        yield Score(f"KS {column}", ks.distance, ks.mean_noise, spread, None, ks.distance, margin, ks.excess)
    for name, cells in (("cells", evaluation.cells), ("cells against raw", evaluation.cells_against_raw)):
        if cells is not None:
            yield Score.of_chi_square(f"{name}: chi2/ndf", cells.chi_square)
            yield Score.of_delta(f"{name}: delta", cells.delta, cells.delta_noise)
    yield from _worst("energy bin", "GeV", evaluation.energy_bins)
    yield from _worst("zenith bin", "degrees", evaluation.zenith_bins)
    by_zenith = evaluation.generated_spectra.by_cos_zenith, evaluation.held_out_spectra.by_cos_zenith
    yield from _worst("cos zenith bin", "", compare_cos_zenith(*by_zenith, evaluation.variance_factor))
    yield from _tails(compare_horizon(*by_zenith, evaluation.variance_factor))
    yield from _tails(replace(tail, name=f"tail {tail.name}") for tail in evaluation.tails)
    yield Score.of_chi_square("charge by cell: chi2/ndf", evaluation.charge)
    charges = evaluation.charge_ratio
    noise = _quadrature(charges.generated_error, charges.held_out_error)
    yield Score.of("charge ratio", charges.generated, charges.held_out, noise, charges.sigma)
    yield Score.of_chi_square("azimuth: chi2/ndf", evaluation.azimuth.chi_square)
    auc, auc_noise = evaluation.classifier.auc, evaluation.classifier.noise
    yield Score.of("classifier: AUC", auc, 0.5, auc_noise, (auc - 0.5) / auc_noise)
    yield from _independence_scores(evaluation.independence)
    if evaluation.rate is not None:
        rate = evaluation.rate
        known = [error for error in (rate.generated_error, rate.held_out_error) if error is not None]
        score = Score.of("rate (Hz/m2)", rate.generated, rate.held_out, hypot(*known) if known else None, rate.sigma)
        yield replace(score, name="rate (Hz/m2), statistical errors", noise_unknown=len(known) < 2)
    yield Score("unphysical muons", evaluation.unphysical.fraction, 0.0)
    if evaluation.unphysical.fraction_before_mapping is not None:
        yield Score("unphysical before mapping", evaluation.unphysical.fraction_before_mapping, 0.0)


def _worst(quantity: str, unit: str, bins: tuple[Bin, ...]) -> Iterator[Score]:
    """Yield one score of many bins: the deviation of the worst one by sigma, the largest excess and margin of all."""
    if bins:
        worst = max(bins, key=lambda a: abs(a.pull))
        place = f"{worst.low:.3g} to {worst.high:.3g} {unit}".rstrip()
        score = Score.of(f"{quantity}, worst of {len(bins)} ({place})", worst.deviation, 0.0, worst.error, worst.pull)
        yield replace(
            score,
            margin=max(3 * a.error for a in bins),
            excess=max(abs(a.deviation) - 3 * a.error for a in bins),
        )


def _tails(tails: Iterable[TailScore]) -> Iterator[Score]:
    """Yield found over expected of each tail that has any muon."""
    for tail in tails:
        if tail.expected > 0:
            yield Score.of(tail.name, tail.found / tail.expected, 1.0, tail.error / tail.expected, tail.pull)


def _independence_scores(independence: Independence) -> Iterator[Score]:
    period = f"{independence.period} {'nominal ' if independence.period_is_nominal else ''}positions"
    yield Score.of_chi_square(f"independence: {period}, chi2/ndf", independence.positions)
    for share in independence.variance_between_positions:
        name = f"independence: variance of {share.column} between positions"
        yield Score.of(name, share.share, share.expected, share.noise, share.sigma)
    for column in dict.fromkeys(a.column for a in independence.autocorrelations):
        lags = [a for a in independence.autocorrelations if a.column == column]
        lag = max(lags, key=lambda a: abs(a.sigma))
        name = f"independence: autocorrelation of {column}, worst of {len(lags)} lags ({lag.lag})"
        yield Score.of(name, lag.correlation, 0.0, lag.noise, lag.sigma)
    for block in independence.block_means:
        name = f"independence: variance of means of {block.length} of {block.column}"
        yield Score.of(name, block.ratio, 1.0, block.noise, block.sigma)
    repeats = independence.repeats
    yield Score("repeated muons", repeats.muons, 0.0)
    noise = repeats.energies_noise / max(repeats.energies_expected, 1.0)
    yield Score("repeated energies, of those float32 explains", repeats.energies_ratio, 1.0, noise)


def _quadrature(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else hypot(a, b)


def _number(value: float | None) -> str:
    return "undefined" if value is None else format(value, ".4g")


def _alike(score: Score) -> str:
    if score.expected is None:
        return ""
    known = [] if score.noise is None else [f"{score.noise:.2g}"]
    noise = " and ".join([*known, *(["unknown"] if score.noise_unknown else [])])
    return _number(score.expected) + (f" ± {noise}" if noise else "")
