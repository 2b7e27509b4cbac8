"""`deepmuon-train convert`: muons of another program to a muon file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from deepmuon_cli.options.quantities import number_from_zero, positive_number, seed_number

if TYPE_CHECKING:  # the libraries are imported when they are needed: --help is answered at once
    from deepmuon_training.data.muon_table import Columns
    from deepmuon_training.sample import Sample

__all__ = ["command"]

FILE = click.Path(path_type=Path)

FORMATS = ("cry-text", "cry-hdf5", "csv", "npy")

KNOWN_OF_CRY = ("columns", "units", "depth", "medium")
KNOWN = {
    "cry-text": KNOWN_OF_CRY,
    "cry-hdf5": (*KNOWN_OF_CRY, "source", "charge", "rate", "rate_uncertainty", "live_time", "area"),
    "csv": (),
    "npy": (),
}
"""Options that have their answer in each format."""

NEEDED = {
    "cry-text": ("charge", "smooth"),
    "cry-hdf5": ("smooth",),
    "csv": ("columns", "units"),
    "npy": ("columns", "units"),
}
"""Options without which each format is not understood."""


def charge_ratio(text: str) -> float:
    """Read -1, +1 or a ratio: mu+ for each mu-.

    Raises
    ------
    click.BadParameter
        If it is none of them.
    """
    if text in ("-1", "+1"):
        return math.inf if text == "+1" else 0.0
    if text == "1":
        raise click.BadParameter("1 can be read in two ways: write +1 for mu+ alone, or 1.0 for as many mu+ as mu-")
    return positive_number(text)


@click.command(name="convert")
@click.argument("input_file", type=FILE, metavar="INPUT")
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The HDF5 file to be written.")
@click.option("--format", "form", type=click.Choice(FORMATS), required=True, help="What INPUT is; see below.")
@click.option("--columns", metavar="NAMES", help="What the columns of a csv or npy are: E,u,v,w,charge.")
@click.option("--units", type=click.Choice(("MeV", "GeV")), help="Unit of the energy in a csv or npy.")
@click.option("--charge", type=charge_ratio, metavar="-1|+1|RATIO", help="mu-, mu+, or how many mu+ for each mu-.")
@click.option("--seed", type=seed_number, metavar="SEED", help="For --charge RATIO; a new one if left out.")
@click.option("--rate", type=positive_number, metavar="HZ", help="Their rate per m2, of 1 MeV and more.")
@click.option("--rate-uncertainty", type=number_from_zero, metavar="HZ", help="Standard uncertainty of --rate.")
@click.option(
    "--live-time",
    type=positive_number,
    metavar="SECONDS",
    help="Instead of --rate: the time in which all muons of INPUT came.",
)
@click.option("--area", type=positive_number, metavar="M2", help="The horizontal area for --live-time.")
@click.option("--depth", type=number_from_zero, metavar="METRES", help="Metres of --medium above; 0 if left out.")
@click.option("--medium", metavar="NAME", help="Geant4's name of what is above; G4_WATER if left out.")
@click.option("--source", metavar="TEXT", help="Who made the sea-level muons; if left out, CRY or the name of INPUT.")
@click.option("--smooth", type=click.Choice(("cry", "none")), help="Take the steps of CRY's tables out, or not.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No closing line.")
def command(input_file: Path, output: Path, form: str, overwrite: bool, quiet: bool, **stated: Any) -> None:
    """Turn muons of another program into a muon file.

    Two muons in the columns of the paper, MeV and the direction cosines to x and y:

    \b
        $ echo 2150,0.1,-0.3 > m.csv
        $ echo 830,0,0.5 >> m.csv
        $ deepmuon-train convert m.csv --format csv --columns E,u,v --units MeV --charge -1 -o m.h5
        m.h5: 2 muons, 0 mu+ and 2 mu-, mean kinetic energy 1.49 GeV, rate unknown

    Formats:

    \b
        cry-text  shower.out of CRY's program testOut at altitude 0; its muons only
        cry-hdf5  /muons/{kinetic_energy, u, v, w, charge}, MeV, and the attributes
                  rate_hz_per_m2 and source
        csv       numbers with commas, or else blanks or tabs, between them
        npy       floating-point numbers of NumPy, one row for each muon

    Columns of a csv or npy, in their order:

    \b
        E         kinetic energy, in --units
        u, v, w   direction of motion, a unit vector, z up: w is negative.
                  Without w, it follows from u and v
        -u -v -w  the opposite: -w where the z axis points down, all three where
                  the vector points to where the muon comes from
        charge    -1 or +1
        pdg_id    13 or -13
        skip      anything else

    Nothing is guessed: where the format has no charge, --charge is asked for, and a rate that is not stated stays
    unknown. Muons below 1 MeV are dropped; any other line or row that can't be a muon is named, and nothing is
    written. CRY draws from histograms: --smooth cry takes their steps out, --smooth none keeps them, and one of the two
    is asked for where the format is CRY's.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime import new_seed
    from deepmuon_runtime.muon_file.output import check_muon_output
    from deepmuon_training.data.conversion import draw_charges
    from deepmuon_training.sample import write_sample

    _check_options(form, stated)
    check_muon_output(output, overwrite)
    sample = _smoothed(_read(input_file, form, stated), stated["smooth"])
    if stated["charge"] is not None:
        sample = draw_charges(sample, stated["charge"], new_seed() if stated["seed"] is None else stated["seed"])
    write_sample(output, sample, overwrite=overwrite)
    if not quiet:
        click.echo(f"{output}: {_summary(sample)}")


def _check_options(form: str, stated: dict[str, Any]) -> None:
    """Refuse options that contradict each other, before anything is read."""
    for name in KNOWN[form]:
        if stated[name] is not None:
            raise click.UsageError(f"{_option(name)} goes without --format {form}, which knows it")
    for name in NEEDED[form]:
        if stated[name] is None:
            raise click.UsageError(f"--format {form} does not say it: give {_option(name)}")
    if form in ("csv", "npy") and _columns(stated).has_charge != (stated["charge"] is None):
        raise click.UsageError("the charge: give either a column charge or pdg_id, or --charge -1, +1 or RATIO")
    if (stated["live_time"] is None) != (stated["area"] is None):
        raise click.UsageError("--live-time and --area go together")
    if stated["rate"] is not None and stated["live_time"] is not None:
        raise click.UsageError("--rate goes without --live-time: the live time decides the rate")
    if stated["rate"] is None and stated["rate_uncertainty"] is not None:
        raise click.UsageError("--rate-uncertainty goes with --rate")
    if stated["smooth"] == "cry" and stated["depth"]:
        raise click.UsageError("--smooth cry is for sea level: the steps of CRY's tables lie elsewhere at depth")
    if stated["medium"] is not None and not (stated["medium"] and stated["medium"].isprintable()):
        raise click.UsageError("--medium is the name of a material, as G4_WATER")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _columns(stated: dict[str, Any]) -> Columns:
    from deepmuon_training.data.muon_table import Columns

    return Columns([name.strip() for name in stated["columns"].split(",")], stated["units"])


def _read(path: Path, form: str, stated: dict[str, Any]) -> Sample:
    """Read the muons, with what is known of them."""
    from deepmuon_training.data.conversion import sample_of
    from deepmuon_training.data.cry import read_cry
    from deepmuon_training.data.cry_text import read_cry_text
    from deepmuon_training.data.muon_table import read_csv, read_npy

    if form == "cry-hdf5":
        return read_cry(path)
    if form == "cry-text":
        muons, _, count_variance = read_cry_text(path)
        sample = sample_of(muons, f"{path.name}, CRY's text output", source=stated["source"] or "CRY")
        return _with_rate(sample, stated, count_variance)
    columns = _columns(stated)
    muons = (read_csv if form == "csv" else read_npy)(path, columns)
    sample = sample_of(
        muons,
        f"{path.name}, columns {columns}",
        source=stated["source"] or path.name,
        depth_m=stated["depth"] or 0.0,
        medium=stated["medium"] or "G4_WATER",
    )
    return _with_rate(sample, stated)


def _with_rate(sample: Sample, stated: dict[str, Any], count_variance: float = 1.0) -> Sample:
    from deepmuon_training.data.conversion import state_rate, take_rate

    if stated["rate"] is not None:
        return state_rate(sample, stated["rate"], stated["rate_uncertainty"])
    if stated["live_time"] is not None:
        return take_rate(sample, stated["live_time"], stated["area"], count_variance)
    return sample


def _smoothed(sample: Sample, how: str | None) -> Sample:
    from deepmuon_training.data.smoothing import StepSmoother, smoothed

    if how == "cry":
        return smoothed(sample, StepSmoother(sample.muons))
    return sample if how is None else replace(sample, smoothed=False)


def _summary(sample: Sample) -> str:
    positive = int((sample.muons.charge > 0).sum())
    mean = sample.muons.kinetic_energy.mean(dtype=float)
    error = "" if sample.rate_uncertainty is None else f" +- {sample.rate_uncertainty:.2g}"
    rate = "unknown" if sample.rate is None else f"{sample.rate:.2f}{error} per m2 and s"
    return (
        f"{len(sample):,} muons, {positive:,} mu+ and {len(sample) - positive:,} mu-, "
        f"mean kinetic energy {mean:.4g} GeV, rate {rate}"
    )
