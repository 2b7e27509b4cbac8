"""`deepmuon-check`: whether a muon file can be trusted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from deepmuon_cli.process.ending import DEFECTIVE
from deepmuon_cli.process.isolation import run_isolated, show_life

if TYPE_CHECKING:  # the libraries are imported when they are needed: --help is answered at once
    from deepmuon_runtime.muon_file.check import Report

__all__ = ["check", "main"]

NAME = "deepmuon-check"
RATES = (
    ("rate_hz_per_m2", "rate_uncertainty_hz_per_m2", "m2 and s"),
    ("target_rate_hz", "target_rate_uncertainty_hz", "s"),
)
"""Attributes with a rate and its uncertainty, and per what it is."""


@click.command(name=NAME, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.argument("file", type=click.Path(path_type=Path))
@click.version_option(package_name="deepmuon-runtime", prog_name=NAME, message="%(prog)s %(version)s")
@click.pass_context
def check(context: click.Context, file: Path) -> None:
    """Check a muon file: its format, its attributes, its checksums and each of its muons.

    \b
        deepmuon-check muons.h5

    MCPL, ROOT and text that DeepMuon wrote are checked likewise, as far as they keep what a muon file does.

    Prints a summary, and a line for each kind of defect with the first muon that has it, counted from 0 in the
    file. A model's muons must lie in its range of energy if it is a released one; of other muons the energy
    must be above 0. What a file says of itself can be false without being a defect: nothing here proves who wrote it.

    Exit codes: 0 no defect, 3 a defect, 2 can't be read as a file of muons.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.formats.check import check_file

    report = check_file(file, progress=lambda _: show_life())
    click.echo(f"{file}: {report.examined:,} muons examined")
    for name, value in _summary(report):
        click.echo(f"  {name:20}{value}")
    for defect in report.defects:
        click.echo(f"defect: {defect}")
    click.echo(f"{len(report.defects) or 'no'} defect{'' if len(report.defects) == 1 else 's'} found")
    if report.defects:
        context.exit(DEFECTIVE)


def main() -> NoReturn:
    """Run `deepmuon-check`."""
    run_isolated(check, NAME)


def _summary(report: Report) -> Iterator[tuple[str, str]]:
    """Yield names and values of what is known."""
    from deepmuon_runtime.errors import shown

    known = report.attributes
    if "depth_m" in known and "medium" in known:
        yield "depth", f"{known['depth_m']:g} m of {known['medium']}"
    if "flux" in known:
        yield "flux at sea level", f"{known['flux']}"
    if "target" in known:
        sizes = " x ".join(f"{size:g}" for size in known.get("target_size_m", ()))
        yield "target", shown(known["target"]) + (f" of {shown(sizes)} m" if sizes else "")
    if cuts := ", ".join(_cuts(known)):
        yield "cuts", cuts
    if report.examined:
        yield "mean kinetic energy", f"{report.mean_energy:.4g} GeV"
        yield "mean cos zenith", f"{report.mean_cos_zenith:.4f}"
    if report.mu_minus:
        yield "mu+ / mu-", f"{report.mu_plus / report.mu_minus:.4f}"
    for rate, uncertainty, of in RATES:
        if rate in known:
            error = f" +- {known[uncertainty]:.2g}" if uncertainty in known else ""
            yield "rate", f"{known[rate]:.5g}{error} per {of}"
    if "live_time_s_m2" in known:
        yield "live time", f"{known['live_time_s_m2']:,.1f} s for 1 m2"
    if "target_live_time_s" in known:
        yield "live time", f"{known['target_live_time_s']:,.1f} s"
    if "live_time_s" in known:
        area = f" on {known['area_m2']:g} m2" if "area_m2" in known else ""
        yield "times", f"of a run of {known['live_time_s']:g} s{area}"
    if "seed" in known:
        yield "seed", f"{known['seed']}"
    if {"shard", "first", "total"} <= known.keys():
        yield "shard", f"{known['shard']}, from muon {known['first']:,} of {known['total']:,}"
    if "model_sha256" in known:
        released = "none of the released ones" if report.model is None else f"the released {report.model.name}"
        yield "model", f"{released}, SHA-256 {known['model_sha256']}"


def _cuts(known: Mapping[str, Any]) -> Iterator[str]:
    """Yield in words what was cut, and what that left."""
    for name, quantity, unit in (("energy", "kinetic energy", "gev"), ("zenith", "zenith angle", "degrees")):
        for end, word in (("min", "from"), ("max", "to")):
            bound = known.get(f"{name}_{end}_{unit}")
            if bound is not None:
                yield f"{quantity} {word} {bound:g} {'GeV' if unit == 'gev' else unit}"
    if "fraction_kept" in known:
        yield f"{known['fraction_kept']:.4g} of all muons"


if __name__ == "__main__":
    main()
