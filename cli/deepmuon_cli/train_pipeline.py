"""`deepmuon-train pipeline`: from sea-level muons to a generator for every depth."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import click

__all__ = ["command"]

FILE = click.Path(path_type=Path)


@click.command(name="pipeline")
@click.argument("settings", type=FILE)
@click.argument("sample", type=FILE)
@click.option(
    "--work",
    type=FILE,
    metavar="FOLDER",
    required=True,
    help="For the files of the run; the same one again goes on with it.",
)
@click.option(
    "--held-out",
    type=FILE,
    metavar="FILE",
    multiple=True,
    help="Muons that trained nothing, to score the generator of their depth; may be given once for each depth.",
)
@click.option("--direct", is_flag=True, help="As direct = true in SETTINGS.")
@click.option("-q", "--quiet", is_flag=True, help="No plan, no progress, only the table.")
def command(settings: Path, sample: Path, work: Path, held_out: tuple[Path, ...], direct: bool, quiet: bool) -> None:
    """Go from the muons of SAMPLE down to a generator for every depth, as SETTINGS say."""
    from deepmuon_training.layer_table import as_csv, as_text, rows
    from deepmuon_training.pipeline import plan
    from deepmuon_training.pipeline_settings import read_pipeline_settings
    from deepmuon_training.whole_file import write_whole

    chosen = read_pipeline_settings(settings)
    pipeline = plan(replace(chosen, direct=chosen.direct or direct), sample, work, held_out)
    pipeline.run((lambda line: None) if quiet else click.echo, progress=not quiet and sys.stderr.isatty())
    table = rows(pipeline.layers)
    write_whole(work / "layers.csv", as_csv(table).encode(), overwrite=True)
    click.echo(as_text(table))
