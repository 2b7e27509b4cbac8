"""`deepmuon-plot`: a picture of muon files."""

from __future__ import annotations

from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import NoReturn

import click

from deepmuon_cli.process.isolation import run_isolated, show_life, take_time

__all__ = ["main", "plot"]

NAME = "deepmuon-plot"
FILE = click.Path(path_type=Path)


@click.command(name=NAME, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.argument("files", type=FILE, nargs=-1, required=True)
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The picture: .png, .pdf or .svg.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.version_option(package_name="deepmuon-runtime", prog_name=NAME, message="%(prog)s %(version)s")
def plot(files: tuple[Path, ...], output: Path, overwrite: bool) -> None:
    """Draw the energy spectrum and the zenith distribution of muon files.

    \b
        deepmuon-gen --depth 0 -n 1e6 -o sea_level.h5
        deepmuon-gen --depth 10 -n 1e6 -o deep.h5
        deepmuon-plot sea_level.h5 deep.h5 -o muons.png

    Several files are drawn over each other: as rates per m2 of horizontal plane where all of them know theirs, else as
    shares of their muons. Needs matplotlib, which `pip install 'deepmuon-runtime[plot]'` brings.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.errors import RefusedError
    from deepmuon_runtime.files.output import check_output
    from deepmuon_runtime.files.whole import whole_file
    from deepmuon_runtime.views.spectra import count_spectra

    check_output(output, overwrite, files)
    form = output.suffix.lstrip(".").lower()
    if form not in ("png", "pdf", "svg"):
        raise RefusedError(f"{output} is no name of a picture: it should end with .png, .pdf or .svg")
    if find_spec("matplotlib") is None:
        raise RefusedError("a picture needs matplotlib: pip install 'deepmuon-runtime[plot]'")
    spectra = [count_spectra(file, progress=lambda _: show_life()) for file in files]
    take_time()

    from deepmuon_runtime.views.plot import draw_spectra

    picture = BytesIO()
    draw_spectra(spectra).savefig(picture, format=form)
    with whole_file(output, overwrite=overwrite) as file:
        file.write(picture.getvalue())


def main() -> NoReturn:
    """Run `deepmuon-plot`."""
    run_isolated(plot, NAME)


if __name__ == "__main__":
    main()
