"""`deepmuon-train fit`: a generator of a muon file."""

from __future__ import annotations

from pathlib import Path

import click

from deepmuon_cli.options.quantities import positive_number, seed_number
from deepmuon_training.generators.registry import ARCHITECTURES

__all__ = ["command"]

FILE = click.Path(path_type=Path)


@click.command(name="fit")
@click.argument("muons", type=FILE)
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The generator, such as generator.pt.")
@click.option(
    "--architecture",
    "architecture_name",
    type=click.Choice(list(ARCHITECTURES)),
    default="quantile",
    show_default=True,
    help="quantile: independent muons, small and fast. transformer: the paper's.",
)
@click.option("-d", "width", type=int, metavar="D", help="Width of a transformer, a multiple of 8; 128 if left out.")
@click.option(
    "--azimuth",
    type=click.Choice(["uniform", "learned"]),
    help="Of quantile: uniform (if left out; refused where it is not) or learned. transformer always learns it.",
)
@click.option("--energy-min", type=positive_number, metavar="GEV", help="No muon has less; if left out, see below.")
@click.option("--energy-max", type=positive_number, metavar="GEV", help="No muon has more.")
@click.option("--zenith-max", type=positive_number, metavar="DEGREES", help="No muon is flatter.")
@click.option("--seed", type=seed_number, default="1", show_default=True, help="Of what is random.")
@click.option("--settings", type=FILE, metavar="FILE", help="How long to train, in TOML; as for the released models.")
@click.option(
    "--checkpoint",
    type=FILE,
    metavar="FOLDER",
    help="Where an interrupted fit is kept; OUTPUT.checkpoint if left out. It is removed in the end.",
)
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No progress bars and no closing lines.")
def command(
    muons: Path,
    output: Path,
    architecture_name: str,
    width: int | None,
    azimuth: str | None,
    energy_min: float | None,
    energy_max: float | None,
    zenith_max: float | None,
    seed: int,
    settings: Path | None,
    checkpoint: Path | None,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Train a generator on a muon file.

    \b
        $ deepmuon-train fit sea_level.h5 -o generator.pt
        generator.pt: quantile, fitted to 300,000 muons, seed 1
        next: deepmuon-train export generator.pt -o model.onnx

    A quantile generator takes less than a minute. Of a network, such as a transformer is, Ctrl-C leaves a checkpoint,
    at most half a minute old, and the same command goes on from it to the same generator; a checkpoint of other muons,
    another seed or other settings is refused. The last twentieth of the muons, 500,000 at most, decides when a network
    stops to learn.

    3,000 muons are the fewest; a good generator takes a million. They need to be independent, and in no particular
    order.

    --azimuth uniform is accepted where harmonics 1 to 4 of the muons' azimuth are zero within noise, below 1 GeV, from
    1 to 10 GeV and above; one in ten thousand uniform samples is refused by chance. Few muons prove little: 100,000
    show a modulation of 3 per cent, 3,000 one of 17.

    Where a source was cut, at an energy or a zenith angle, its generator ends there exactly, and muons of one charge
    stay of one charge. A sharp cut is found in the muons. State one that is not, as where few muons are near it:
    --energy-max 1000. A muon beyond what is stated is refused.

    A file of settings has any of these keys, here with the values that they have if left out:

    \b
        quantile, --azimuth learned:      transformer:
        azimuth.steps = 4000              batch = 32768
        azimuth.learning_rate = 0.01      directions = 32
                                          schedule.steps = 6000
                                          schedule.learning_rate = 1e-3
                                          charge.steps = 3000
                                          calibration = 4e6
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.files.output import check_output

    check_output(output, overwrite, [muons, *filter(None, [settings])])
    if width is not None and architecture_name != "transformer":
        raise click.UsageError("-d goes with --architecture transformer: a quantile generator has no width")
    if azimuth is not None and architecture_name != "quantile":
        raise click.UsageError("--azimuth goes with --architecture quantile: a transformer always learns it")

    from deepmuon_training.generators.fit import fit_generator
    from deepmuon_training.generators.registry import architecture
    from deepmuon_training.learning.support import Stated
    from deepmuon_training.pipeline.settings_file import read_table, settings_from
    from deepmuon_training.sample import read_sample

    kind = architecture(architecture_name)
    table = {} if settings is None else read_table(settings)
    if width is not None:
        table["d"] = width
    chosen = settings_from(kind.settings(), table, "the settings" if settings is None else str(settings))
    sample = read_sample(muons)
    folder = _made(checkpoint or output.with_name(output.name + ".checkpoint"))
    try:
        generator = fit_generator(
            sample,
            architecture_name,
            seed=seed,
            settings=chosen,
            azimuth="learned" if azimuth == "learned" else "uniform",
            stated=Stated(energy_min, energy_max, zenith_max),
            checkpoint_folder=folder,
            progress=not quiet,
        )
        generator.save(output, overwrite=overwrite)
        for name in kind.checkpoints:
            (folder / name).unlink(missing_ok=True)
    finally:
        _remove_if_empty(folder)
    if not quiet:
        click.echo(f"{output}: {architecture_name}, fitted to {len(sample):,} muons, seed {seed}")
        click.echo(f"next: deepmuon-train export {output} -o model.onnx")


def _made(folder: Path) -> Path:
    from deepmuon_runtime.errors import RefusedError, reason

    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise RefusedError(f"no checkpoint can be kept in {folder}: {reason(error)}") from error
    return folder


def _remove_if_empty(folder: Path) -> None:
    if not any(folder.iterdir()):
        folder.rmdir()
