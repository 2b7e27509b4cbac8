"""`deepmuon-convert`: muons from one format to another."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import click

from deepmuon_cli.options.formats import FORMAT
from deepmuon_cli.process.isolation import run_isolated, show_life
from deepmuon_cli.process.stdout import told_faults

__all__ = ["convert", "main"]

NAME = "deepmuon-convert"


@click.command(name=NAME, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.argument("file", metavar="IN", type=click.Path(path_type=Path))
@click.argument("output", metavar="OUT", type=click.Path(path_type=Path, allow_dash=True))
@click.option("--format", "form", type=FORMAT, help="Of OUT; what the end of its name says if left out.")
@click.option("--units", type=click.Choice(("GeV", "MeV")), help="Unit of the energy in text; GeV if left out.")
@click.option("--no-header", is_flag=True, help="Text without comments and names of the columns.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.version_option(package_name="deepmuon-runtime", prog_name=NAME, message="%(prog)s %(version)s")
def convert(file: Path, output: Path, form: str | None, units: str | None, no_header: bool, overwrite: bool) -> None:
    """Write the muons of a file to one of another format: HDF5, MCPL, ROOT or text.

    \b
        $ deepmuon-gen --depth 10 -n 1000 -q -o muons.h5
        $ deepmuon-convert muons.h5 muons.csv --units MeV
        $ grep depth_m muons.csv
        # depth_m = 10.0
        $ grep -v '#' muons.csv | head -n 1
        kinetic_energy_MeV,u,v,w,pdg_id
        $ deepmuon-convert muons.h5 - --no-header | wc -l
        1000
        $ deepmuon-convert muons.csv muons.mcpl

    The end of OUT says its format: .h5, .mcpl, .mcpl.gz, .root, .csv or .csv.gz, where --format does not; - is text to
    stdout. IN is a file of any of these that DeepMuon wrote. What is known of the muons goes along. A damaged file
    gives none: for stdout it is read twice, and verified before the first line.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.formats.convert import convert_file

    if str(output) != "-":
        convert_file(
            file,
            output,
            format=form,
            unit=units,
            header=not no_header,
            overwrite=overwrite,
            progress=lambda _: show_life(),
        )
        return
    if form not in (None, "csv"):
        raise click.UsageError(f"stdout takes text alone, and --format asks for {form}")

    from deepmuon_runtime.formats.csv import csv_pieces
    from deepmuon_runtime.formats.registry import opened_muons

    with opened_muons(file) as source:
        for _ in source.pieces():
            show_life()
    with opened_muons(file) as source:
        _print(csv_pieces(source, unit=units or "GeV", header=not no_header))


def main() -> NoReturn:
    """Run `deepmuon-convert`."""
    run_isolated(convert, NAME)


def _print(pieces: Iterator[bytes]) -> None:
    """Write to stdout, unbuffered: nothing is left to be written when its reader has gone."""
    with told_faults(), open(sys.stdout.fileno(), "wb", buffering=0, closefd=False) as stdout:
        for piece in pieces:
            left = memoryview(piece)
            while left:
                left = left[stdout.write(left) :]
            show_life()


if __name__ == "__main__":
    main()
