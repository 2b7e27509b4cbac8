"""The formats of files of muons, as a choice: `--help` is answered without the libraries that know them."""

from __future__ import annotations

import click

__all__ = ["FORMAT", "FORMATS"]

FORMATS = ("h5", "mcpl", "mcpl.gz", "root", "csv", "csv.gz")
"""Names of `deepmuon_runtime.formats.registry.FORMATS`."""

FORMAT = click.Choice(FORMATS)
