"""`deepmuon-train source`: muons of a flux, at sea level or at a depth."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import click

from deepmuon_cli.options.quantities import muon_number, positive_number, seed_number

if TYPE_CHECKING:  # imported when needed: --help is answered at once
    from deepmuon_training.sample import Sample

__all__ = ["command"]

FILE = click.Path(path_type=Path)


@click.command(name="source")
@click.option("-n", "--number", type=muon_number, metavar="NUMBER", required=True, help="How many muons: 1e6.")
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The HDF5 file to be written.")
@click.option(
    "--flux",
    default="ecomug",
    metavar="FLUX",
    show_default=True,
    help="measured, gccly, ecomug or TABLE.csv, see above.",
)
@click.option(
    "--charge-ratio",
    type=positive_number,
    metavar="RATIO",
    help="mu+ for each mu-, of gccly and ecomug; or else 1.28.",
)
@click.option("--depth", type=float, default=0.0, metavar="METRES", help="Of the medium; sea level if left out.")
@click.option("--medium", metavar="NAME", help="water or rock, the standard one (Z = 11, A = 22); water if left out.")
@click.option("--density", type=positive_number, metavar="G/CM3", help="Of the medium, if not its own, 1 or 2.65.")
@click.option("--seed", type=seed_number, metavar="SEED", help="0 to 2^64 - 1; a new one if left out.")
@click.option("--processes", type=click.IntRange(min=1), help="Of mulder side by side; one per core if left out.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No progress bar and no closing line.")
def command(
    number: int,
    output: Path,
    flux: str,
    charge_ratio: float | None,
    depth: float,
    medium: str | None,
    density: float | None,
    seed: int | None,
    processes: int | None,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Make muons from a parametric flux, without any data, at sea level or at any depth.

    \b
        $ deepmuon-train source -n 1e5 --seed 1 -o sea_level.h5
        sea_level.h5: 100,000 muons, rate 129.03 per m2 and s, equivalent live time 775.0 s for 1 m2, seed 1

    The muons follow a flux times the cosine of the zenith angle, which is what a horizontal plane sees. Their rate is
    its integral. Kinetic energies go from 1 MeV to 100 TeV. Fewer muons of a seed are the first of more. The fluxes
    are compared in docs/fluxes.md:

    \b
    measured   fitted to BESS-TeV and L3+C, with the charge ratio that they saw
    gccly      M. Guan et al., arXiv:1509.06176
    ecomug     D. Pagano, G. Bonomi et al., NIM A 1014 (2021) 165732; EcoMug itself stops at 1 TeV
    TABLE.csv  your own: kinetic energy in GeV, cos zenith, flux of mu+ and of mu- in 1/(m2 s sr GeV)

    With --depth they are muons that came from this flux through so much water or rock, carried back to the surface by
    mulder (LGPL-3; pip install 'deepmuon-training[mulder]'), which reaches depths where of a million muons that
    "deepmuon-train transport" starts with none arrives:

    \b
        deepmuon-train source --flux measured --medium rock --depth 1000 -n 4e6 --seed 1 -o rock-1000m.h5

    Each core gives 5,000 to 20,000 muons a second, and the rate first of all takes some seconds. The muons of a seed
    are the same for any --processes. A run with a --seed that was interrupted goes on where it is repeated: what is
    done lies beside the output, in a folder unfinished-NAME. A few muons, whose share is told, repeat another's energy
    and zenith angle. What the physics is: docs/physics.md.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime import new_seed
    from deepmuon_runtime.errors import RefusedError
    from deepmuon_runtime.muon_file.output import check_muon_output
    from deepmuon_training.fluxes.by_name import find_flux
    from deepmuon_training.fluxes.sea_level import write_sea_level

    seed = new_seed() if seed is None else seed
    found = find_flux(flux, charge_ratio)
    check_muon_output(output, overwrite, [flux])
    if depth == 0:
        if medium is not None or density is not None:
            raise RefusedError("a medium or a density was given, and the depth is 0: give --depth as well")
        sample, notes = write_sea_level(output, found, number, seed=seed, overwrite=overwrite), ""
    else:
        from deepmuon_training.underground.depth_file import write_depth
        from deepmuon_training.underground.overburden import overburden
        from deepmuon_training.underground.place import place

        written = write_depth(
            output,
            place(found, overburden(medium or "water", density), depth),
            number,
            seed=seed,
            folder=(unfinished := output.with_name(f"unfinished-{output.name}")),
            processes=processes,
            overwrite=overwrite,
            progress=not quiet,
        )
        shutil.rmtree(unfinished)
        sample, notes = written.sample, f", {written.repeated:.2%} repeated"
    if not quiet:
        click.echo(f"{output}: {number:,} muons{_where(sample)}, rate {_rates(sample, number)}{notes}, seed {seed}")


def _where(sample: Sample) -> str:
    return f" under {sample.depth_m:g} m of {sample.medium}" if sample.depth_m else ""


def _rates(sample: Sample, number: int) -> str:
    """Say the rate, and the live time that the muons are equivalent to."""
    assert sample.rate is not None
    live_time = f"equivalent live time {number / sample.rate:,.1f} s for 1 m2"
    if sample.rate_uncertainty is None:
        return f"{sample.rate:.2f} per m2 and s, {live_time}"
    return f"{sample.rate:.4g} +- {sample.rate_uncertainty / sample.rate:.2%} per m2 and s, {live_time}"
