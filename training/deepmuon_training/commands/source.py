"""`deepmuon-train source`: sea-level muons from a formula."""

from __future__ import annotations

from pathlib import Path

import click

from deepmuon_cli.options.quantities import muon_number, positive_number, seed_number

__all__ = ["command"]

FILE = click.Path(path_type=Path)


@click.command(name="source")
@click.option("-n", "--number", type=muon_number, metavar="NUMBER", required=True, help="How many muons: 1e6.")
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The HDF5 file to be written.")
@click.option("--charge-ratio", type=positive_number, metavar="RATIO", help="mu+ for each mu-; 1.28 if left out.")
@click.option("--seed", type=seed_number, metavar="SEED", help="0 to 2^64 - 1; a new one if left out.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No closing line.")
def command(
    number: int, output: Path, charge_ratio: float | None, seed: int | None, overwrite: bool, quiet: bool
) -> None:
    """Make sea-level muons from a parametric flux, to try everything without any data.

    \b
        $ deepmuon-train source -n 1e5 --seed 1 -o sea_level.h5
        sea_level.h5: 100,000 muons, rate 129.03 per m2 and s, equivalent live time 775.0 s for 1 m2, seed 1

    The muons follow the formula of EcoMug (D. Pagano, G. Bonomi et al., NIM A 1014 (2021) 165732) times the cosine of
    the zenith angle, which is what a horizontal plane sees. Their rate is its integral. Kinetic energies go
    from 1 MeV to 100 TeV; EcoMug itself stops at 1 TeV unless told otherwise. The charge depends neither
    on energy nor on angle. Fewer muons of a seed are the first of more.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime import new_seed
    from deepmuon_training.data.ecomug import CHARGE_RATIO, write_sea_level

    seed = new_seed() if seed is None else seed
    ratio = CHARGE_RATIO if charge_ratio is None else charge_ratio
    sample = write_sea_level(output, number, seed=seed, charge_ratio=ratio, overwrite=overwrite)
    if not quiet:
        assert sample.rate is not None
        click.echo(
            f"{output}: {number:,} muons, rate {sample.rate:.2f} per m2 and s, equivalent live time "
            f"{number / sample.rate:,.1f} s for 1 m2, seed {seed}"
        )
