"""`deepmuon-merge`: the shards of a run to one file."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import click

from deepmuon_cli.process.isolation import run_isolated, show_life

__all__ = ["main", "merge"]

NAME = "deepmuon-merge"
FILE = click.Path(path_type=Path)


@click.command(name=NAME, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.argument("shards", type=FILE, nargs=-1, required=True)
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The HDF5 file to be written.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("--virtual", is_flag=True, help="Let the shards keep the muons: the file only refers to them.")
@click.option("-q", "--quiet", is_flag=True, help="No closing line.")
@click.version_option(package_name="deepmuon-runtime", prog_name=NAME, message="%(prog)s %(version)s")
def merge(shards: tuple[Path, ...], output: Path, overwrite: bool, virtual: bool, quiet: bool) -> None:
    """Join the shards of a run to the file that one machine would have written.

    \b
        deepmuon-merge part-1.h5 part-2.h5 part-3.h5 -o muons.h5

    The files come from `deepmuon-gen --shard`, in any order. Shards of different runs, missing ones, damaged ones, and
    muons that are in two of them are refused.

    With --virtual nothing is copied: HDF5 finds the muons in the shards, by their paths relative to the folder of
    the new file, so that they are moved together or not at all. The shards are read once, and damaged ones refused.

    \b
        deepmuon-merge --virtual part-1.h5 part-2.h5 part-3.h5 -o muons.h5

    Where a shard is missing HDF5 reads NaN, without an error; deepmuon-check names it.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.muon_file.merge import merge_shards

    number = merge_shards(shards, output, overwrite=overwrite, virtual=virtual, progress=lambda _: show_life())
    if not quiet:
        click.echo(f"{output}: {number:,} muons of {len(shards)} shard{'s' * (len(shards) > 1)}")


def main() -> NoReturn:
    """Run `deepmuon-merge`."""
    run_isolated(merge, NAME)


if __name__ == "__main__":
    main()
