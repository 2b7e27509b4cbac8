"""`deepmuon-train pipeline`: from sea-level muons to a generator for every depth."""

from __future__ import annotations

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
    """Go from the muons of SAMPLE down to a generator for every depth, as SETTINGS say.

    Fit a generator to the sample, draw muons from it, carry them through a slab by Geant4, fit a generator to those
    that came through, and so on. With examples/pipeline/small.toml, 20 m of water in two layers:

    \b
        $ deepmuon-train source -n 2e5 --seed 1 -q -o sea_level.h5
        $ deepmuon-train pipeline small.toml sea_level.h5 --work run -q
        depth/m  rate/(1/m2/s)  surviving fraction  mean energy/GeV    muons              model
              0        129.035                   1   5.115 +- 0.037  200,000   quantile-0m.onnx
             10        51.4932    0.3991 +- 0.0011   7.780 +- 0.093   79,813  quantile-10m.onnx
             20        26.0123  0.20159 +- 0.00071  10.960 +- 0.096  101,032  quantile-20m.onnx

    \b
    SETTINGS is a TOML file with any of these keys, here with the values that they have if left out:
        architecture = "quantile"     or "transformer"
        azimuth = "uniform"           of quantile: or "learned"
        layers = 5                    slabs below the sample's depth
        layer_m = 10                  thickness of each in m
        material = "G4_WATER"         one of Geant4's NIST materials, or standard_rock
        density                       in g/cm3; the material's own
        muons = 4_000_000             drawn from each generator
        muons_per_part = 500_000      carried between two savings
        scored_muons = 20_000_000     drawn to compare a generator with held-out muons
        direct = false                carry on the muons that came through, with no network between
        family = false                in the end one model of all depths, also between the layers
        seed = 1                      from which all seeds are derived

    and tables for the fit: [quantile.azimuth], [transformer], [transformer.schedule], ..., with the keys
    that deepmuon-train fit --help shows. An unknown key is an error.

    A run that was killed goes on by the same command: finished steps are not done again, a fit goes on from its last
    checkpoint, a transport from its last part. It ends with the same muons and models as an undisturbed run. FOLDER
    holds every file on the way, the settings, and layers.csv, the table.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.files.whole import write_whole
    from deepmuon_training.pipeline.loop import plan
    from deepmuon_training.pipeline.settings import read_pipeline_settings
    from deepmuon_training.pipeline.table import as_csv, as_text, rows

    chosen = read_pipeline_settings(settings)
    pipeline = plan(replace(chosen, direct=chosen.direct or direct), sample, work, held_out)
    pipeline.run((lambda line: None) if quiet else click.echo, progress=not quiet)
    table = rows(pipeline.layers)
    write_whole(work / "layers.csv", as_csv(table).encode(), overwrite=True)
    click.echo(as_text(table))
