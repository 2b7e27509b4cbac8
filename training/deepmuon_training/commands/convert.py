"""`deepmuon-train convert`: muons of another program to a muon file."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from deepmuon_cli.options.quantities import number_from_zero, positive_number, seed_number

if TYPE_CHECKING:  # the libraries are imported when they are needed: --help is answered at once
    from deepmuon_training.data.foreign.table import Table
    from deepmuon_training.sample import Sample

__all__ = ["command"]

FILE = click.Path(path_type=Path)

UNITS = ("eV", "keV", "MeV", "GeV", "TeV", "PeV")

FORMATS = ("cry-text", "cry-hdf5", "csv", "npy", "mcpl", "root")

KNOWN_OF_CRY = ("columns", "units", "angles", "muons_only", "depth", "medium")
KNOWN = {
    "cry-text": KNOWN_OF_CRY,
    "cry-hdf5": (*KNOWN_OF_CRY, "source", "charge", "rate", "rate_uncertainty", "live_time", "area"),
}
"""Options that have their answer in a format."""

NEEDED = {
    "cry-text": ("charge", "smooth"),
    "cry-hdf5": ("smooth",),
    "npy": ("columns",),
}
"""Options without which a format is not understood; what headings leave open is asked for when they are read."""


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
@click.option("--columns", metavar="NAMES", help="What the columns of a table are: E,u,v,w,charge.")
@click.option("--units", type=click.Choice(UNITS), help="Unit of energies and momenta, where no heading says it.")
@click.option("--angles", type=click.Choice(("deg", "rad")), help="Unit of angles, where no heading says it.")
@click.option("--muons-only", is_flag=True, default=None, help="Leave other particles out, and count them.")
@click.option("--charge", type=charge_ratio, metavar="-1|+1|RATIO", help="mu-, mu+, or how many mu+ for each mu-.")
@click.option("--seed", type=seed_number, metavar="SEED", help="For --charge RATIO and weights; a new one if left out.")
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
            m.csv, columns E [MeV], u, v: 2 rows
            charge stated: all mu-

    Formats:

    \b
        cry-text  shower.out of CRY's program testOut at altitude 0; its muons only
        cry-hdf5  /muons/{kinetic_energy, u, v, w, charge}, MeV, and the attributes
                  rate_hz_per_m2 and source
        csv       numbers with commas, semicolons, tabs or blanks between them; what
                  deepmuon-convert wrote
        npy       floating-point numbers of NumPy, one row for each muon
        mcpl      MCPL; needs pip install 'deepmuon-training[mcpl]'
        root      a tree of ROOT, muons.root or muons.root:tree; its columns are its
                  branches; needs pip install 'deepmuon-training[root]'

    Text may be packed by gzip. One heading, comments (#) and blank lines are passed over; any other line that is no row
    is named. Headings that are plain need no --columns, and units in them no --units. Columns in their order are
    E,u,v; by their headings, E=Ekin,u=dirX,v=dirY. They are

    \b
        E         kinetic energy; or Etot, total energy; or p, momentum
        u, v, w   direction of motion, a unit vector, z up: w is negative.
                  Without w, it follows from u and v
        -u -v -w  the opposite: -w where the z axis points down, all three where
                  the vector points to where the muon comes from
        px py pz  momentum, in place of E, u, v, w; or -px, -py, -pz
        theta phi direction of motion, z up: theta is above 90 degrees
        zenith azimuth, or cos_zenith azimuth
                  where the muon comes from; zenith,phi and theta,azimuth are
                  possible, too
        charge    -1 or +1; or a particle's number, of which mu- and mu+ are
                  pdg_id 13, -13; corsika_id 6, 5; musun_id 11, 10; phits_id 7, 6
        weight    the muons are drawn by it, and weigh the same afterwards
        skip      anything else, text too

    Nothing is guessed: where the format has no charge, --charge is asked for, and a rate that is not stated stays
    unknown. Muons below 1 MeV are dropped; any other line or row that can't be a muon is named, and nothing is
    written. CRY draws from histograms: --smooth cry takes their steps out, --smooth none keeps them, and one of the two
    is asked for where the format is CRY's.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime import new_seed
    from deepmuon_runtime.muon_file.output import check_muon_output
    from deepmuon_runtime.muon_file.writer import write_muons
    from deepmuon_training.data.conversion import draw_charges
    from deepmuon_training.data.foreign.root_table import file_of

    _check_options(form, stated)
    check_muon_output(output, overwrite, [file_of(input_file) if form == "root" else input_file])
    stated["seed"] = new_seed() if stated["seed"] is None else stated["seed"]
    sample, exposure = _read(input_file, form, stated)
    sample = _smoothed(sample, stated["smooth"])
    if stated["charge"] is not None:
        sample = draw_charges(sample, stated["charge"], stated["seed"])
    write_muons(output, sample.muons, {**sample.attributes, **exposure}, overwrite=overwrite)
    if not quiet:
        click.echo(f"{output}: {_summary(sample)}")
        for line in sample.provenance:
            click.echo(f"    {line}")


def _check_options(form: str, stated: dict[str, Any]) -> None:
    """Refuse options that contradict each other, before anything is read."""
    for name in KNOWN.get(form, ()):
        if stated[name] is not None:
            raise click.UsageError(f"{_option(name)} goes without --format {form}, which knows it")
    for name in NEEDED.get(form, ()):
        if stated[name] is None:
            raise click.UsageError(f"--format {form} does not say it: give {_option(name)}")
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


def _read(path: Path, form: str, stated: dict[str, Any]) -> tuple[Sample, dict[str, float]]:
    """Read the muons, with what is known of them, and the live time on an area that they stand for, where it is."""
    from deepmuon_training.data.conversion import drop_lowest
    from deepmuon_training.data.cry import read_cry
    from deepmuon_training.data.cry_text import read_cry_text
    from deepmuon_training.sample import Sample

    if form == "cry-hdf5":
        return read_cry(path), {}
    if form == "cry-text":
        muons, _, count_variance = read_cry_text(path)
        told = f"{path.name}, CRY's text output: {len(muons):,} muons"
        sample = Sample(muons, depth_m=0.0, source=stated["source"] or "CRY", provenance=(told,), flux="cry")
        return _with_rate(drop_lowest(sample, "MeV"), stated, count_variance), {}
    return _read_table(path, form, stated)


def _read_table(path: Path, form: str, stated: dict[str, Any]) -> tuple[Sample, dict[str, float]]:
    from deepmuon_training.data.conversion import drop_lowest, unweighted
    from deepmuon_training.data.foreign.headings import columns_of
    from deepmuon_training.data.foreign.notes import EXPOSURE, check_stated, known_of, of_all_rows
    from deepmuon_training.data.foreign.reading import read_foreign
    from deepmuon_training.sample import sample_of

    table = _opened(path, form, stated["columns"])
    columns = columns_of(table, stated["columns"], stated["units"], stated["angles"])
    if columns.has_charge != (stated["charge"] is None):
        raise click.UsageError("the charge: give either a column charge or pdg_id, or --charge -1, +1 or RATIO")
    if stated["muons_only"] and columns.id_kind is None:
        raise click.UsageError("--muons-only goes with a column pdg_id, corsika_id, musun_id or phits_id")
    if columns.has_weight and stated["live_time"] is not None:
        raise click.UsageError("--live-time counts muons, which a column weight says do not count alike: --rate")
    known = known_of(table)
    found = read_foreign(table, columns, muons_only=bool(stated["muons_only"]))
    known = of_all_rows(table, known, found.rows)
    check_stated(table, known, stated)
    for doubt in columns.doubts(found.muons):
        warnings.warn(doubt, stacklevel=2)
    rows = f"{found.rows:,} row{'s' * (found.rows > 1)}"
    muons, told = found.muons, [f"{path.name}, columns {columns}: {rows}", *found.left_out]
    if found.weights is not None:
        muons, how = unweighted(muons, found.weights, stated["seed"])
        told.append(how)
    attributes = {
        "depth_m": stated["depth"] or 0.0,
        "medium": stated["medium"] or "G4_WATER",
        "created_by": path.name,
        **known,
        **({} if stated["source"] is None else {"source": stated["source"]}),
        "provenance": [*known.get("provenance", ()), *told],
    }
    sample = drop_lowest(sample_of(muons, attributes, path), columns.unit)
    return _with_rate(sample, stated), {name: known[name] for name in EXPOSURE if name in known}


def _opened(path: Path, form: str, names: str | None) -> Table:
    """Open a table; text has as many columns as --columns names in their order."""
    from deepmuon_training.data.foreign.mcpl_table import open_mcpl
    from deepmuon_training.data.foreign.npy_table import open_npy
    from deepmuon_training.data.foreign.root_table import open_root
    from deepmuon_training.data.foreign.text_table import open_text

    if form == "csv":
        return open_text(path, None if names is None or "=" in names else names.count(",") + 1)
    return {"npy": open_npy, "mcpl": open_mcpl, "root": open_root}[form](path)


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
