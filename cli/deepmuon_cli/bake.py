"""`deepmuon-bake`: a model of one depth from a family."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import click

from deepmuon_cli.options.completion import depths, fluxes, media
from deepmuon_cli.options.quantities import depth_metres
from deepmuon_cli.process.ending import run

__all__ = ["bake", "main"]

NAME = "deepmuon-bake"
FILE = click.Path(path_type=Path)
SURFACES = {"plane": 0, "sphere": 1}


@click.command(name=NAME, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.argument("family", type=FILE, required=False)
@click.option(
    "--depth",
    type=depth_metres,
    metavar="METRES",
    required=True,
    shell_complete=depths,
    help="A depth in the range of the family.",
)
@click.option(
    "--flux",
    metavar="NAME",
    shell_complete=fluxes,
    help="Of the released family, at sea level: cry (the default) or measured.",
)
@click.option(
    "--medium",
    metavar="NAME",
    shell_complete=media,
    help="Of the released family: water (the default) or rock.",
)
@click.option(
    "--surface",
    type=click.Choice(list(SURFACES)),
    default="plane",
    help="What the muons cross: a horizontal plane (if left out), or a sphere.",
)
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The ONNX file to be written.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No closing line.")
@click.version_option(package_name="deepmuon-runtime", prog_name=NAME, message="%(prog)s %(version)s")
def bake(
    family: Path | None,
    depth: float,
    flux: str | None,
    medium: str | None,
    surface: str,
    output: Path,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Take the model of one depth out of a family: a smaller file, for a program of your own.

    \b
        deepmuon-bake family.onnx --depth 13.7 -o water-13.7m.onnx
        deepmuon-bake --flux measured --medium rock --depth 1000 -o rock-1000m.onnx

    FAMILY is an ONNX file; if left out, the released one of the flux and the medium. The muons of the new file are
    those that `deepmuon-gen` makes of the family at this depth and of the same seed. The file says in `baked_from`
    which family it is from, and its bytes are the same each time, on one type of CPU.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime import Generator, RefusedError
    from deepmuon_runtime.files.output import check_output
    from deepmuon_runtime.files.whole import write_whole
    from deepmuon_runtime.model.baking import bake as baked
    from deepmuon_runtime.model.opening import read_file
    from deepmuon_runtime.model.released import read_released, released_model

    for name, chosen in {"flux": flux, "medium": medium}.items():
        if family is not None and chosen is not None:
            raise click.UsageError(f"a FAMILY goes without --{name}: the file has its own")
    check_output(output, overwrite, [] if family is None else [family])
    if family is None:
        released = released_model(depth, flux=flux, medium=medium)
        if not released.is_family:
            raise RefusedError(f"no released family has {depth:g} m: {released.name} is a model of this depth alone")
        name, contents = released.name, read_released(released)
    else:
        Generator.open(depth, file=family, device="cpu")  # a stranger's file is tried before it is trusted
        name, contents = str(family), read_file(family)
    fixed = baked(contents, depth, SURFACES[surface], name)
    write_whole(output, fixed, overwrite=overwrite)
    if not quiet:
        click.echo(f"{output}: {name} at {depth:g} m, {len(fixed) / 1e3:.0f} kB")


def main() -> NoReturn:
    """Run `deepmuon-bake`."""
    run(bake, NAME)


if __name__ == "__main__":
    main()
