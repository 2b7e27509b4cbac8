"""`deepmuon-train family`: generators of several depths as one ONNX file for any depth between."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["command"]

FILE = click.Path(path_type=Path)


@click.command(name="family")
@click.argument("generators", type=FILE, nargs=-1, required=True, metavar="GENERATOR...")
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The ONNX file to be written.")
@click.option(
    "--rates",
    type=FILE,
    metavar="TABLE",
    help="Rates at further depths: CSV with the columns depth_m, rate_hz_per_m2, rate_uncertainty_hz_per_m2.",
)
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No closing lines.")
def command(generators: tuple[Path, ...], output: Path, rates: Path | None, overwrite: bool, quiet: bool) -> None:
    """Write generators of several depths as one ONNX file, which has any depth from the first to the last.

    \b
        $ deepmuon-train family 0m.pt 1m.pt 3m.pt -o water.onnx
        water.onnx: quantile, 3 knots from 0 to 3 m of G4_WATER, 129.03 to 96.13 muons per m2 and s, 486,532 bytes
        - Of the knots between the first and the last, that of 1 m is hardest to interpolate from its ...
        - 0 m: Above 50 GeV, where the training sample thins out, the flux above E goes as E^-1.82, ...
        ...
        $ deepmuon-gen --model water.onnx --depth 1.7 -n 1e6 -o muons.h5

    Each GENERATOR is what `fit` made of muons at one depth, a knot; there are two or more, in any order. They have one
    medium, one flux and one architecture, quantile with a uniform azimuth. Between knots the maps are interpolated, by
    the four nearest: muons of the same latents move smoothly with depth. Near the surface knots have to be dense, say
    0, 0.1, 0.3, 1, 3, 6 and 10 m, and each other's neighbours should be less than twice as deep further down. The notes
    say what is missed where a knot is left out: between knots it should be less. Score it there:

    \b
        deepmuon-train evaluate water.onnx held_out.h5 --depth 1.7 -o report.html

    The rate at a knot is that of its training sample; --rates adds depths, or says what a sample does not, and is what
    counts where both know one. Between them the logarithm of the rate is a cubic spline. A pipeline's layers.csv can be
    given as it is. If no rate is known the file has none.

    The file also holds the flux through a sphere, which counts muons by 1 / cos zenith more than a plane does.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.files.output import check_output

    check_output(output, overwrite, [*generators, *([rates] if rates else [])])

    from deepmuon_training.families.rate_table import read_rates
    from deepmuon_training.generators.family import family_of
    from deepmuon_training.generators.fitted import FittedGenerator

    more_rates = read_rates(rates) if rates else ()
    fitted = family_of([FittedGenerator.load(path) for path in generators], more_rates)
    mismatch = fitted.export(output, overwrite=overwrite)
    if not quiet:
        click.echo(f"{output}: {fitted}, {output.stat().st_size:,} bytes")
        for note in (*fitted.notes, mismatch.note):
            click.echo(f"- {note}")
