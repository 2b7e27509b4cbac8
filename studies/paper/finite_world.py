"""What the paper's finite worlds do to its spectrum at 50 m.

    python -m studies.paper.finite_world sea_level.h5

The paper carries muons to 50 m in five worlds of water, each 60 m x 60 m x 10 m: a muon starts at a random place on the
top of each, and is lost if it leaves by a side. Its comparison carries them through one world of 300 m x 300 m x 50 m.
Here the same muons go through both, and through water without sides. The sums go to finite_world.json beside this
script; worlds that are in it are not repeated.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import MU_MINUS
from deepmuon_training.energy_transform import box_cox, inverse_box_cox
from deepmuon_training.sample import Sample, read_sample
from deepmuon_training.transport.slab import Transported, transport

RESULT = Path(__file__).with_suffix(".json")

PAPER_MEANS = {10: 3.1541, 50: 3.4116}
"""Means of x = (9 E + 1)^(1/9) of mu-, E in MeV, in the configuration of the paper's repository, by depth in m."""

WORLDS = {
    "without sides": (None, 5),
    "five of 60 m x 60 m x 10 m": ((60.0, 60.0), 5),
    "one of 300 m x 300 m x 50 m": ((300.0, 300.0), 1),
}
"""Widths of a slab in m, and how many of them the 50 m are."""

DEPTH = 50.0


@dataclass(frozen=True)
class Spectrum:
    """What is left at a depth; errors are of the muons carried here, the rate's without that of the sea-level rate.

    Parameters
    ----------
    depth_m : float
        Metres of water.
    muons, sideways : int
        Muons there; of those that entered the last slab, muons that left it by a side.
    rate, rate_error : float
        Muons per second and m2.
    mean_energy, mean_energy_error : float
        Mean kinetic energy in GeV.
    mean_x, mean_x_error : float
        Mean of (9 E + 1)^(1/9), E in MeV, of mu- alone as in the paper.
    mean_cos_zenith : float
        Mean cosine of the zenith angle.
    """

    depth_m: float
    muons: int
    sideways: int
    rate: float
    rate_error: float
    mean_energy: float
    mean_energy_error: float
    mean_x: float
    mean_x_error: float
    mean_cos_zenith: float

    @classmethod
    def of(cls, sample: Sample, started: int, sideways: int) -> Spectrum:
        """Sum up the muons left of `started` ones at sea level."""
        muons = sample.muons
        energy = muons.kinetic_energy.astype(float)
        x = inverse_box_cox(energy[muons.pdg_id == MU_MINUS])
        lost = 1 - len(muons) / started
        return cls(
            depth_m=sample.depth_m,
            muons=len(muons),
            sideways=sideways,
            rate=sample.rate,
            rate_error=sample.rate * math.sqrt(lost / len(muons)),
            mean_energy=float(energy.mean()),
            mean_energy_error=_error_of_mean(energy),
            mean_x=float(x.mean()),
            mean_x_error=_error_of_mean(x),
            mean_cos_zenith=float(muons.cos_zenith.mean(dtype=float)),
        )


def _error_of_mean(values: NDArray[np.float64]) -> float:
    return float(values.std() / math.sqrt(len(values)))


@click.command(help=__doc__)
@click.argument("sea_level", type=click.Path(exists=True, path_type=Path))
@click.option("-n", "--number", type=int, help="Take only the first so many muons.")
@click.option("--seed", type=int, default=1, show_default=True)
def main(sea_level: Path, number: int | None, seed: int) -> None:
    """Carry the muons through each world, and write what is left of them."""
    sample = read_sample(sea_level)
    sample = sample.then(f"the first {number} muons", muons=sample.muons[:number])
    what = {"seed": seed, "sea_level_muons": len(sample), "source": list(sample.provenance)}
    result = json.loads(RESULT.read_text()) if RESULT.exists() else {}
    worlds = result["worlds"] if result.items() >= what.items() else {}
    for name in [name for name in WORLDS if name not in worlds]:
        worlds[name] = [asdict(spectrum) for spectrum in carry(sample, name, seed)]
        RESULT.write_text(json.dumps({**what, "worlds": worlds}, indent=2) + "\n")
    click.echo(table(worlds))


def carry(sample: Sample, name: str, seed: int) -> list[Spectrum]:
    """Return the spectra from sea level to 50 m in a world."""
    box, slabs = WORLDS[name]
    started = len(sample)
    spectra = [Spectrum.of(sample, started, sideways=0)]
    for slab in range(slabs):
        carried: Transported = transport(sample, DEPTH / slabs, seed=seed + slab, box=box)
        sample = carried.sample
        spectra.append(Spectrum.of(sample, started, carried.sideways))
    return spectra


def table(worlds: dict[str, list[dict[str, float]]]) -> str:
    """Return the spectra at the paper's depths as Markdown, the paper's means beside them."""
    lines = [
        "| world of water | depth [m] | per m² and s | mean E [GeV] | mean cos zenith | mean x of μ⁻ | E of it [GeV] |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    for depth, paper in PAPER_MEANS.items():
        for name, spectra in worlds.items():
            lines += [row(name, spectrum) for spectrum in spectra if spectrum["depth_m"] == depth]
        lines.append(f"| the paper's configuration | {depth} | | | | {paper} | {box_cox(paper):.2f} |")
    return "\n".join(lines)


def row(name: str, spectrum: dict[str, float]) -> str:
    """Return the row of one spectrum."""
    cells = [
        f"{spectrum['depth_m']:g}",
        f"{spectrum['rate']:.3f} ± {spectrum['rate_error']:.3f}",
        f"{spectrum['mean_energy']:.2f} ± {spectrum['mean_energy_error']:.2f}",
        f"{spectrum['mean_cos_zenith']:.3f}",
        f"{spectrum['mean_x']:.4f} ± {spectrum['mean_x_error']:.4f}",
        f"{box_cox(spectrum['mean_x']):.2f}",
    ]
    return f"| {name} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
