"""Types of the paths that studies are given."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["FILE", "FOLDER"]

FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)
