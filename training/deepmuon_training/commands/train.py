"""`deepmuon-train`: make generators from muon samples, step by step or in one run."""

from __future__ import annotations

from importlib import import_module
from typing import NoReturn

import click

from deepmuon_cli.process.ending import run

__all__ = ["main", "train"]

NAME = "deepmuon-train"

_COMMANDS = {
    "convert": "Turn muons of another program into a muon file.",
    "source": "Make muons from a parametric flux, at sea level or at any depth.",
    "transport": "Carry muons through water or another material by Geant4.",
    "fit": "Train a generator on a muon file.",
    "export": "Write a trained generator as an ONNX file.",
    "family": "Write generators of several depths as one ONNX file for any depth between.",
    "evaluate": "Compare an ONNX generator with a muon file.",
    "pipeline": "Go from sea-level muons to a generator for every depth.",
}
"""In the order of the work; `NAME` is `command` in `deepmuon_training.commands.NAME`."""


class _Commands(click.Group):
    """Imports a command when it is run: torch alone takes seconds, which `--help` should not."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        command: click.Command = import_module(f"deepmuon_training.commands.{cmd_name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))


@click.group(
    cls=_Commands, name=NAME, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(package_name="deepmuon-training", prog_name=NAME, message="%(prog)s %(version)s")
def train() -> None:
    """Make muon generators from muon samples.

    Each command reads and writes muon files (HDF5) or generators, and has a worked example in its own --help:

    \b
        deepmuon-train source -n 1e6 -o sea_level.h5
        deepmuon-train fit sea_level.h5 -o generator.pt
        deepmuon-train export generator.pt -o model.onnx
        deepmuon-gen --model model.onnx -n 1e6 -o muons.h5
    """  # noqa: D301 - click looks for the character \b


def main() -> NoReturn:
    """Run `deepmuon-train`."""
    run(train, NAME)


if __name__ == "__main__":
    main()
