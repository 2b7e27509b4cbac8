"""`deepmuon-train transport`: muons through a slab of matter."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from deepmuon_cli.options.quantities import positive_number, seed_number

if TYPE_CHECKING:  # imported when needed: --help is answered at once
    from deepmuon_training.transport.slab import Transported

__all__ = ["command"]

FILE = click.Path(path_type=Path)


@click.command(name="transport")
@click.argument("muons", type=FILE)
@click.option("--thickness", type=positive_number, required=True, metavar="METRES", help="Of the slab.")
@click.option("-o", "--output", type=FILE, required=True, metavar="FILE", help="The HDF5 file to be written.")
@click.option(
    "--material",
    default="G4_WATER",
    show_default=True,
    metavar="NAME",
    help="What the slab is made of: one of Geant4's NIST materials, or standard_rock.",
)
@click.option("--density", type=positive_number, metavar="G/CM3", help="Of the material, if not its own.")
@click.option(
    "--box",
    type=positive_number,
    nargs=2,
    metavar="X Y",
    help="Widths of a finite slab in metres; an infinite one if left out.",
)
@click.option("--seed", type=seed_number, metavar="SEED", help="0 to 2^64 - 1; a new one if left out.")
@click.option("--processes", type=click.IntRange(min=1), help="Geant4 side by side; one per core if left out.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No progress bar and no closing lines.")
def command(
    muons: Path,
    thickness: float,
    output: Path,
    material: str,
    density: float | None,
    box: tuple[float, float] | None,
    seed: int | None,
    processes: int | None,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Carry the muons of a file through a slab by Geant4, and write those that cross its lower plane.

    \b
        $ deepmuon-train source -n 1e4 --seed 1 -q -o sea_level.h5
        $ deepmuon-train transport sea_level.h5 --thickness 10 --seed 1 -o below.h5
        below.h5: 4,005 of 10,000 muons (40.05%, 39.56% to 40.55%) under 10 m of G4_WATER, 51.68 per m2 and s, seed 1
             5,357 can't arrive: not carried
               638 stopped or decayed

    Through rock, and through a finite world of water:

    \b
        deepmuon-train transport sea_level.h5 --thickness 5 --material standard_rock --density 2.71 -o rock.h5
        deepmuon-train transport sea_level.h5 --thickness 10 --box 60 60 -o box.h5

    Standard rock has Z = 11, A = 22 and, unless another is stated, 2.65 g/cm3. In a finite world the muons start at
    places uniform over its upper face, and those that leave it by its sides are lost. The same muons and seed give the
    same survivors for any --processes. Muons that have a depth already can go on only in the material above them.
    The interval of the surviving fraction is exact (Clopper and Pearson), at 68 % confidence. Where no muon survives
    nothing is written.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime import new_seed
    from deepmuon_runtime.muon_file.output import check_muon_output
    from deepmuon_training.sample import read_sample, write_sample
    from deepmuon_training.transport.material import medium
    from deepmuon_training.transport.slab import refuse_none, transport

    check_muon_output(output, overwrite, [muons])
    seed = new_seed() if seed is None else seed
    carried = transport(
        read_sample(muons),
        thickness,
        seed=seed,
        processes=processes,
        material=material,
        density=density,
        box=box,
        progress=not quiet,
    )
    refuse_none(len(carried.sample), carried.started, thickness, medium(material, density))
    write_sample(output, carried.sample, overwrite=overwrite)
    if not quiet:
        click.echo(_closing_lines(output, carried, seed))


def _closing_lines(output: Path, carried: Transported, seed: int) -> str:
    sample = carried.sample
    low, high = carried.surviving_fraction_interval
    fraction = f"{carried.surviving_fraction:.2%}, {low:.2%} to {high:.2%}"
    rate = "rate unknown" if sample.rate is None else f"{sample.rate:.4g} per m2 and s"
    fates = {
        "can't arrive: not carried": carried.screened,
        "stopped or decayed": carried.stopped,
        "left by the sides": carried.sideways,
        "left upwards": carried.upward,
        "arrived with less than 1 MeV": carried.below_minimum,
    }
    return "\n".join(
        [
            f"{output}: {len(sample):,} of {carried.started:,} muons ({fraction}) under {sample.depth_m:g} m of "
            f"{sample.medium}, {rate}, seed {seed}",
            *(f"{number:10,} {fate}" for fate, number in fates.items() if number),
        ]
    )
