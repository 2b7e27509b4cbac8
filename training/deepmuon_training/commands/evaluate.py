"""`deepmuon-train evaluate`: a model's muons against held-out ones, as a report."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from deepmuon_cli.bake import SURFACES
from deepmuon_cli.options.quantities import muon_number, number_from_zero, positive_number, seed_number

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
@click.option("--depth", type=number_from_zero, metavar="METRES", help="Of a family: where it is scored.")
@click.option(
    "--surface",
    type=click.Choice(list(SURFACES)),
    help="Of a family: its muons through a horizontal plane, as they are if left out, or through a sphere.",
)
@click.option("--seed", type=seed_number, default="1", show_default=True, help="Of the generated muons.")
@click.option(
    "--variance-factor",
    type=positive_number,
    metavar="FACTOR",
    help="Of the held-out counts, over that of independent muons; as their file says, or 1, if left out.",
)
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("-q", "--quiet", is_flag=True, help="No progress bar and no closing lines.")
def command(
    model: Path,
    held_out: Path,
    output: Path,
    json_output: Path | None,
    number: int | None,
    depth: float | None,
    surface: str | None,
    seed: int,
    variance_factor: float | None,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Compare a model's muons with those of a muon file, which it was not trained on.

    \b
        $ deepmuon-train evaluate model.onnx held_out.h5 -n 1e6 -o report.html
        | score | measured | alike samples | sigma | excess | target | effective limit | verdict |
        | KS energy | 0.001762 | 0.002131 ± 0.00064 |  | -0.0022 | excess ≤ 0.001 | ± 0.005 | too few muons to tell |
        ...
        report.html: 1,000,000 generated muons against 200,000 of held_out.h5, seed 1

    MODEL is any ONNX file that keeps the project's contract. The report is one HTML file with tables and pictures,
    which needs no network. Each score stands beside what two alike samples of these sizes show. 100,000 muons are
    the fewest, of either; only more of them show small errors: a target that their noise hides is neither met nor
    missed. Both have to be from one depth, in one medium; of a family, --depth says which. Muons through a sphere are
    scored by those of them that a horizontal plane has, one in 1/cos zenith.

    Muons that come in showers are not independent: their counts vary by more than their square root. --variance-factor
    says by how much; of CRY's spectra it is 1.17 at most.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.files.output import check_output

    if output == json_output:
        raise click.UsageError("--json needs a file of its own, other than --output")
    for path in filter(None, (output, json_output)):
        check_output(path, overwrite, [model, held_out])

    from deepmuon_runtime import Generator
    from deepmuon_runtime.files.whole import write_whole
    from deepmuon_training.progress import progress_bar
    from deepmuon_training.reports.report import html_report
    from deepmuon_training.sample import read_sample
    from deepmuon_training.scores.evaluate import FEWEST_MUONS
    from deepmuon_training.scores.model_evaluation import evaluate_model
    from deepmuon_training.scores.scorecard import markdown_scorecard

    facts, truth = Generator.open(file=model, depth=depth, device="cpu").model, read_sample(held_out)
    number = number or max(FEWEST_MUONS, min(MOST_MUONS, TIMES_HELD_OUT * len(truth)))
    with progress_bar(number, "drawing", " muons", hidden=quiet) as bar:

        def drawn(muons: int) -> None:
            bar.update(muons)
            if bar.n == number:
                bar.set_description("drawn, scoring takes a minute or two", refresh=sys.stderr.isatty())

        evaluation = evaluate_model(
            model,
            truth,
            number,
            seed=seed,
            variance_factor=variance_factor,
            depth=depth,
            surface=None if surface is None else SURFACES[surface],
            progress=drawn,
        )
    write_whole(output, html_report(evaluation, facts, truth, str(held_out)).encode(), overwrite=overwrite)
    if json_output is not None:
        write_whole(json_output, evaluation.to_json().encode(), overwrite=overwrite)
    if not quiet:
        click.echo(markdown_scorecard(evaluation, facts.architecture))
        click.echo(f"{output}: {number:,} generated muons against {len(truth):,} of {held_out}, seed {seed}")
