"""The report of an evaluation: one HTML file that holds everything, pictures too."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Sequence
from html import escape
from itertools import pairwise
from math import hypot, sqrt

from matplotlib.figure import Figure

from deepmuon_runtime.model.metadata import SPHERE, Model
from deepmuon_training.data.cry_cells import COS_ZENITH_EDGES
from deepmuon_training.reports.pictures import draw_charge, draw_energy, draw_zenith
from deepmuon_training.sample import Sample
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.histograms import Bin
from deepmuon_training.scores.score import Score
from deepmuon_training.scores.scorecard import TABLE_HEAD, scorecard, table_rows

__all__ = ["html_report"]

_PICTURES: dict[str, Callable[[Evaluation], Figure]] = {
    "Energy spectrum, and its ratio to the held-out one": draw_energy,
    "Zenith angle": draw_zenith,
    "Fraction of mu+": draw_charge,
}

_OPEN = ("missed", "too few muons to tell", "not measured")

_STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #ffffff; --soft: #57606a; --line: #d8dee4; --band: #f4f6f8;
  --good: #1a6b35; --bad: #b3261e; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e8ea; --paper: #15181c; --soft: #a2abb5; --line: #353b43; --band: #1d2127;
    --good: #6fd08c; --bad: #ff8a80; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 62rem;
  margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
p { color: var(--soft); max-width: 46rem; } p.summary { color: var(--ink); font-size: 1.1rem; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.9rem; }
th, td { text-align: left; padding: 0.25rem 0.9rem 0.25rem 0; border-bottom: 1px solid var(--line); }
th { font-weight: 600; } td.text { overflow-wrap: anywhere; } tbody tr:hover { background: var(--band); }
.met { color: var(--good); font-weight: 600; } .missed { color: var(--bad); font-weight: 600; }
figure { display: inline-block; margin: 0.5rem 1rem 0.5rem 0; max-width: 29rem; }
figure img { width: 100%; background: #ffffff; border: 1px solid var(--line); border-radius: 4px; }
figcaption { color: var(--soft); font-size: 0.9rem; }
"""


def html_report(evaluation: Evaluation, model: Model, held_out: Sample, held_out_name: str) -> str:
    """Write an evaluation as one HTML page, which needs no other file and no network.

    Parameters
    ----------
    evaluation
        The scores.
    model
        The generator's metadata.
    held_out
        What the generated muons were compared with.
    held_out_name
        Its file.

    Returns
    -------
    The same bytes for the same arguments.
    """
    scores = scorecard(evaluation, model.architecture)
    through = " through a sphere" if evaluation.surface == SPHERE else ""
    title = f"{model.architecture}, {model.depth_m:g} m of {model.medium}{through}"
    body = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{escape(model.name)} against {escape(held_out_name)}</p>",
        f'<p class="summary">{escape(_summary(evaluation, scores))}</p>',
        "<h2>Scores</h2>",
        "<p>Beside each number stands what two samples of one distribution and these sizes show: a score means "
        "something only where it is beyond that. Sigma is the deviation in its noise, excess what is beyond three "
        "sigma. Targets are those of the released models of this architecture, where there are any; the effective "
        "limit is the smallest deviation that these numbers of muons let one call missed.</p>",
        *_independence_of(evaluation),
        _table(TABLE_HEAD, table_rows(scores)),
        "<h2>Pictures</h2>",
        "<p>Line and band: held-out muons with one standard deviation; points: generated ones.</p>",
        *(_figure(draw(evaluation), caption) for caption, draw in _PICTURES.items()),
        "<h2>Energy bins</h2>",
        _bins(evaluation.energy_bins, "GeV"),
        "<h2>Zenith bins</h2>",
        _bins(evaluation.zenith_bins, "degrees"),
        "<h2>Cos zenith, to the horizon</h2>",
        _table(("from", "to", "generated", "held out", "found / expected"), _cos_zenith(evaluation)),
        "<h2>Azimuth</h2>",
        "<p>Amplitude of each harmonic of the azimuth (0: uniform), and that of the difference of generated and "
        "held-out muons with its root mean square in alike samples.</p>",
        _table(("energy", "order", "generated", "held out", "difference", "alike samples"), _harmonics(evaluation)),
        "<h2>The model</h2>",
        _table(("what", "value"), _model_facts(model, evaluation.surface)),
        "<h2>The held-out muons</h2>",
        _table(("what", "value"), _sample_facts(held_out, held_out_name)),
    ]
    return _page(title, "\n".join(body))


def _summary(evaluation: Evaluation, scores: Sequence[Score]) -> str:
    compared = (
        f"{evaluation.generated_muons:,} generated muons (seed {evaluation.seed}) against "
        f"{evaluation.held_out_muons:,} held-out ones."
    )
    judged = [score for score in scores if score.target]
    if not judged:
        differing = [score.name for score in scores if (score.verdict or "").startswith("differs")]
        return f"{compared} There are no targets for this architecture; " + (
            f"beyond noise: {', '.join(differing)}." if differing else "nothing differs beyond noise."
        )
    names = {verdict: [score.name for score in judged if score.verdict == verdict] for verdict in _OPEN}
    opened = [f"{verdict}: {', '.join(found)}" for verdict, found in names.items() if found]
    met = sum(score.met is True for score in judged)
    return f"{compared} {'; '.join([f'{met} of {len(judged)} targets are met', *opened])}."


def _independence_of(evaluation: Evaluation) -> list[str]:
    """Say how correlated the held-out muons were taken to be, where that was stated."""
    if evaluation.variance_factor == 1:
        return []
    return [
        f"<p>Counts of held-out muons are taken to vary by {evaluation.variance_factor:g} times the variance of "
        "independent ones.</p>"
    ]


def _cos_zenith(evaluation: Evaluation) -> list[tuple[str, ...]]:
    p, q = evaluation.generated_spectra.by_cos_zenith, evaluation.held_out_spectra.by_cos_zenith
    s = sum(p) / sum(q)
    return [
        (
            f"{low:.2f}",
            f"{high:.2f}",
            f"{a:,}",
            f"{b:,}",
            f"{a / (s * b):.3f} ± {hypot(sqrt(a), s * sqrt(b)) / (s * b):.3f}",
        )
        if b
        else (f"{low:.2f}", f"{high:.2f}", f"{a:,}", "0", "undefined")
        for (low, high), a, b in zip(pairwise(COS_ZENITH_EDGES), p, q, strict=True)
    ]


def _model_facts(model: Model, surface: int) -> list[tuple[str, str]]:
    """Return what a model says of itself, where a family has the surface that was scored."""
    known = {"file": model.name, "sha256": model.sha256, "size": f"{model.size:,} bytes", **model.metadata}
    known |= {"surface": str(surface)} if "surface" in known else {}
    return [(name, str(value)) for name, value in known.items()]


def _sample_facts(sample: Sample, name: str) -> list[tuple[str, str]]:
    facts = {key: value for key, value in sample.attributes.items() if key != "provenance"}
    steps = [(f"provenance {number}", step) for number, step in enumerate(sample.provenance, start=1)]
    return [("file", name), ("muons", f"{len(sample):,}"), *((key, str(value)) for key, value in facts.items()), *steps]


def _bins(bins: Iterable[Bin], unit: str) -> str:
    head = (f"from [{unit}]", f"to [{unit}]", "generated", "held out", "deviation", "error", "sigma")
    rows = [_bin_cells(a) for a in bins]
    return _table(head, rows) if rows else "<p>No bin has 10,000 muons of both samples.</p>"


def _bin_cells(a: Bin) -> list[str]:
    edges, counts = (f"{a.low:.4g}", f"{a.high:.4g}"), (f"{a.generated:,}", f"{a.held_out:,}")
    return [*edges, *counts, f"{a.deviation:+.2%}", f"{a.error:.2%}", f"{a.pull:+.1f}"]


def _harmonics(evaluation: Evaluation) -> list[tuple[str, ...]]:
    return [
        (energies, str(a.order), f"{a.generated:.4f}", f"{a.held_out:.4f}", f"{a.difference:.4f}", f"{a.noise:.4f}")
        for energies, harmonics in evaluation.azimuth.harmonics.items()
        for a in harmonics
    ]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    header = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    lines = [f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows]
    return (
        f'<div class="wide"><table><thead><tr>{header}</tr></thead>\n<tbody>\n'
        + "\n".join(lines)
        + "\n</tbody></table></div>"
    )


def _cell(text: str) -> str:
    kind = text if text in ("met", "missed") else "text"
    return f'<td class="{kind}">{escape(text)}</td>'


def _figure(figure: Figure, caption: str) -> str:
    picture = io.BytesIO()
    figure.savefig(picture, format="png", metadata={"Software": None})  # no version: the same bytes
    data = base64.b64encode(picture.getvalue()).decode()
    return (
        f'<figure><img src="data:image/png;base64,{data}" alt="{escape(caption)}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _page(title: str, body: str) -> str:
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )
