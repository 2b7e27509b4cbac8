"""`deepmuon-train source`: sea-level muons from a formula or a table."""

from __future__ import annotations

from pathlib import Path

import click

from deepmuon_cli.options.quantities import muon_number, positive_number, seed_number

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
@click.option("--seed", type=seed_number, metavar="SEED", help="0 to 2^64 - 1; a new one if left out.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No closing line.")
def command(
    number: int, output: Path, flux: str, charge_ratio: float | None, seed: int | None, overwrite: bool, quiet: bool
) -> None:
    """Make sea-level muons from a parametric flux, without any data.

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
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime import new_seed
    from deepmuon_runtime.muon_file.output import check_muon_output
    from deepmuon_training.fluxes.by_name import find_flux
    from deepmuon_training.fluxes.sea_level import write_sea_level

    seed = new_seed() if seed is None else seed
    found = find_flux(flux, charge_ratio)
    check_muon_output(output, overwrite, [flux])
    sample = write_sea_level(output, found, number, seed=seed, overwrite=overwrite)
    if not quiet:
        assert sample.rate is not None
        click.echo(
            f"{output}: {number:,} muons, rate {sample.rate:.2f} per m2 and s, equivalent live time "
            f"{number / sample.rate:,.1f} s for 1 m2, seed {seed}"
        )
