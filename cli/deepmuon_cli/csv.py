"""`deepmuon-csv`: a muon file as text."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import click

from deepmuon_cli.options.quantities import metres, seed_number
from deepmuon_cli.process.isolation import run_isolated, show_life
from deepmuon_cli.process.stdout import told_faults

__all__ = ["csv", "main"]

NAME = "deepmuon-csv"
FILE = click.Path(path_type=Path, allow_dash=True)


@click.command(name=NAME, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.argument("file", type=FILE)
@click.option(
    "-o", "--output", type=FILE, metavar="FILE", required=True, help="The CSV file to be written; - is stdout."
)
@click.option("--units", type=click.Choice(("GeV", "MeV")), default="GeV", help="Unit of the energy; GeV if left out.")
@click.option(
    "--phits", "side", type=metres, metavar="SIDE", help="A list for PHITS instead, on a square of so many metres."
)
@click.option("--seed", type=seed_number, metavar="SEED", help="Of the places for --phits; a new one if left out.")
@click.option("--no-header", is_flag=True, help="No comments, and no line with the names of the columns.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.version_option(package_name="deepmuon-runtime", prog_name=NAME, message="%(prog)s %(version)s")
def csv(
    file: Path, output: Path, units: str, no_header: bool, side: float | None, seed: int | None, overwrite: bool
) -> None:
    """Write a muon file as comma-separated text, one muon a line.

    \b
        $ deepmuon-gen --depth 10 -n 1000 -q -o muons.h5
        $ deepmuon-csv muons.h5 --units MeV -o muons.csv
        $ grep depth_m muons.csv
        # depth_m = 10.0
        $ grep -v '#' muons.csv | head -n 1
        kinetic_energy_MeV,u,v,w,pdg_id
        $ grep -v '#' muons.csv | wc -l
        1001

    Columns: kinetic energy in GeV or MeV; direction of motion u, v, w, a unit vector, z up; pdg_id, 13 for mu- and -13
    for mu+. Nine digits keep every number as it is in the file. What the file says of its muons stands above them in
    lines that begin with #. A damaged file gives no text: for stdout it is read twice, and verified before the first
    line.

    For PHITS (s-type = 17) a line holds particle, x, y, z in cm, u, v, w, energy in MeV, weight, and time:

    \b
        deepmuon-csv muons.h5 --phits 10 --seed 1 -o muons.phits
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.errors import RefusedError
    from deepmuon_runtime.files.output import check_output
    from deepmuon_runtime.files.whole import whole_file
    from deepmuon_runtime.latents.philox import new_seed
    from deepmuon_runtime.muon_file.reader import read_attributes, verify_muons
    from deepmuon_runtime.room import check_disk
    from deepmuon_runtime.views.text import SHORTEST_LINE, csv_pieces, phits_pieces

    if side is None:
        texts = csv_pieces(file, unit=units, header=not no_header)
    elif 0 < side < math.inf:
        texts = phits_pieces(file, side=side, seed=new_seed() if seed is None else seed)
    else:
        raise RefusedError(f"a square of {side:g} m has no place for muons: --phits takes a finite length above 0")
    pieces = (text.encode() for text in texts)
    if str(output) == "-":
        verify_muons(file, progress=lambda _: show_life())
        _print(pieces)
        return
    folder = check_output(output, overwrite, [file]).parent
    number = read_attributes(file)["count"]
    check_disk(folder, number * SHORTEST_LINE, f"{number:,} lines")
    with whole_file(output, overwrite=overwrite) as text:
        for piece in pieces:
            text.write(piece)
            show_life()


def main() -> NoReturn:
    """Run `deepmuon-csv`."""
    run_isolated(csv, NAME)


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
