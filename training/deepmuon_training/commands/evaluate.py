"""`deepmuon-train evaluate`: a model's muons against held-out ones, as a report."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from deepmuon_cli.options.quantities import muon_number, seed_number

if TYPE_CHECKING:
    from deepmuon_runtime import Generator, Muons

__all__ = ["command"]

FILE = click.Path(path_type=Path)
MOST_MUONS = 20_000_000  # whose memory a laptop has
TIMES_HELD_OUT = 10  # more than these would no longer lessen the noise


@click.command(name="evaluate")
@click.argument("model", type=FILE)
@click.argument("held_out", type=FILE)
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The report, such as report.html.")
@click.option("--json", "json_output", type=FILE, metavar="FILE", help="All scores in JSON, too.")
@click.option(
    "-n",
    "--number",
    type=muon_number,
    metavar="NUMBER",
    help="Muons to generate; if left out ten times the held-out ones, but at most 2e7.",
)
@click.option("--seed", type=seed_number, default="1", show_default=True, help="Of the generated muons.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("-q", "--quiet", is_flag=True, help="No progress bar and no closing lines.")
def command(
    model: Path,
    held_out: Path,
    output: Path,
    json_output: Path | None,
    number: int | None,
    seed: int,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Compare a model's muons with those of a muon file, which it was not trained on.

    \b
        $ deepmuon-train evaluate model.onnx held_out.h5 -n 1e6 -o report.html
        | score | measured | alike samples | sigma | target | verdict |
        | KS energy | 0.002524 | 0.002131 ± 0.00064 |  | excess ≤ 0.001 | met |
        ...
        report.html: 1,000,000 generated muons against 200,000 of held_out.h5, seed 1

    MODEL is any ONNX file that keeps the project's contract. The report is one HTML file with tables and pictures,
    which needs no network. Each score stands beside what two alike samples of these sizes show. 100,000 muons are
    the fewest, of either; only more of them show small errors.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.files.output import check_output

    if output == json_output:
        raise click.UsageError("--json needs a file of its own, other than --output")
    for path in filter(None, (output, json_output)):
        check_output(path, overwrite)

    from deepmuon_runtime import Generator
    from deepmuon_runtime.files.whole import write_whole
    from deepmuon_training.reports.report import html_report
    from deepmuon_training.sample import read_sample
    from deepmuon_training.scores.evaluate import FEWEST_MUONS, evaluate
    from deepmuon_training.scores.scorecard import markdown_scorecard

    generator, truth = Generator.open(file=model, device="cpu"), read_sample(held_out)
    facts = generator.model
    number = number or max(FEWEST_MUONS, min(MOST_MUONS, TIMES_HELD_OUT * len(truth)))
    evaluation = evaluate(
        _drawn(generator, number, seed, progress=not quiet and sys.stderr.isatty()),
        truth.muons,
        seed=seed,
        muons_per_draw=facts.muons_per_draw,
        generated_rate=_rate(facts.rate_hz_per_m2, facts.rate_uncertainty_hz_per_m2),
        truth_rate=_rate(truth.rate, truth.rate_uncertainty),
        energy_range=(facts.energy_min_gev, facts.energy_max_gev),
    )
    write_whole(output, html_report(evaluation, facts, truth, str(held_out)).encode(), overwrite=overwrite)
    if json_output is not None:
        write_whole(json_output, evaluation.to_json().encode(), overwrite=overwrite)
    if not quiet:
        click.echo(markdown_scorecard(evaluation, facts.architecture))
        click.echo(f"{output}: {number:,} generated muons against {len(truth):,} of {held_out}, seed {seed}")


def _drawn(generator: Generator, number: int, seed: int, progress: bool) -> list[Muons]:
    """Draw muons in pieces, with a bar on stderr."""
    from tqdm import tqdm

    pieces = []
    with tqdm(total=number, desc="drawing", unit="muon", unit_scale=True, disable=not progress) as bar:
        for piece in generator.chunks(number, seed):
            pieces.append(piece)
            bar.update(len(piece))
        bar.set_description("drawn, scoring takes a minute or two")
    return pieces


def _rate(rate: float | None, uncertainty: float | None) -> tuple[float, float] | None:
    """Return a rate with its uncertainty, 0 where nobody stated one."""
    return None if rate is None else (rate, uncertainty or 0.0)
