"""A muon sample: muons at one depth, with what is known of where they come from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file import READ_ERRORS, read_attributes, read_muons, reason, write_muons
from deepmuon_runtime.muons import Muons
from deepmuon_training.foreign_muons import numbered, pdg_id_of, refuse_unphysical

__all__ = [
    "CRY_SHOWER_VARIANCE",
    "HELD_OUT_CRY_MUONS",
    "MINIMUM_ENERGY",
    "Sample",
    "read_cry",
    "read_sample",
    "write_sample",
]

MINIMUM_ENERGY = 1e-3
"""Muons below this kinetic energy [GeV] are not part of any sample."""

HELD_OUT_CRY_MUONS = 2_000_000
"""The last so many muons of the CRY sample test the generators; none of them ever trains one."""

CRY_SHOWER_VARIANCE = 2.10
"""Variance of the number of CRY's muons, in units of Poisson's.

Muons of one shower come together, so their number varies by more than its square root: its variance is <m^2> / <m>
times as large, m being the muons of a shower in CRY's 100 m box. Measured with CRY 1.7 on 120,000,000 muons; the
scatter of the rates of 44 runs of 1,000,000 and 4,000,000 agrees.
"""

CRY_COLUMNS = ("kinetic_energy", "u", "v", "w", "charge")


@dataclass(frozen=True)
class Sample:
    """Muons crossing a horizontal plane downwards at one depth.

    Parameters
    ----------
    muons : Muons
        The muons, n rows.
    depth_m : float
        Metres of `medium` under the sea-level plane.
    source : str
        Who made the sea-level muons.
    provenance : tuple of str
        What was done to them, in order.
    medium : str
        Geant4's name of the overburden.
    rate, rate_uncertainty : float or None
        Muons per second and m2 of the plane, and its standard uncertainty; None where unknown.
    smoothed : bool or None
        Whether the generator's histogram steps were taken out.
    """

    muons: Muons
    depth_m: float
    source: str
    provenance: tuple[str, ...] = ()
    medium: str = "G4_WATER"
    rate: float | None = None
    rate_uncertainty: float | None = None
    smoothed: bool | None = None

    def __len__(self) -> int:
        """Return the number of muons."""
        return len(self.muons)

    def then(self, what: str, **changes: Any) -> Sample:
        """Return a changed copy whose provenance ends with `what` was done."""
        return replace(self, provenance=(*self.provenance, what), **changes)

    @property
    def attributes(self) -> dict[str, object]:
        """What a muon file says of the sample; what is unknown is left out."""
        attributes = {
            "depth_m": self.depth_m,
            "medium": self.medium,
            "source": self.source,
            "provenance": list(self.provenance),
            "rate_hz_per_m2": self.rate,
            "rate_uncertainty_hz_per_m2": self.rate_uncertainty,
            "smoothed": self.smoothed,
        }
        return {name: value for name, value in attributes.items() if value is not None}


def read_sample(path: str | Path, first: int = 0, count: int | None = None) -> Sample:
    """Read a sample, or a part of it, from a muon file of version 1.

    Parameters
    ----------
    path
        The file.
    first, count
        Which muons, as in `deepmuon_runtime.read_muons`; all if left out.

    Raises
    ------
    RefusedError
        If the file is no such file, or does not hold the muons asked for.
    """
    attributes = read_attributes(path)
    rate = attributes.get("rate_hz_per_m2")
    uncertainty = attributes.get("rate_uncertainty_hz_per_m2")
    smoothed = attributes.get("smoothed")
    return Sample(
        muons=read_muons(path, first, count),
        depth_m=float(attributes["depth_m"]),
        source=str(attributes.get("source", attributes["created_by"])),
        provenance=tuple(str(line) for line in attributes.get("provenance", ())),
        medium=str(attributes["medium"]),
        rate=None if rate is None else float(rate),
        rate_uncertainty=None if uncertainty is None else float(uncertainty),
        smoothed=None if smoothed is None else bool(smoothed),
    )


def write_sample(path: str | Path, sample: Sample, *, overwrite: bool = False) -> None:
    """Write a sample as a muon file of version 1.

    Raises
    ------
    RefusedError
        If the file exists (without `overwrite`) or can't be written.
    """
    write_muons(path, sample.muons, sample.attributes, overwrite=overwrite)


def read_cry(path: str | Path, part: slice = slice(None)) -> Sample:
    """Read CRY's sea-level muons as they were made: MeV, direction, charge.

    The rate is CRY's (all its muons over live time and box area), times the fraction of at least 1 MeV; its
    uncertainty allows for the showers (`CRY_SHOWER_VARIANCE`).

    Parameters
    ----------
    path
        HDF5 file with /muons/{kinetic_energy, u, v, w, charge} and the attributes
        rate_hz_per_m2 and source.
    part
        Rows to read, ``slice(-HELD_OUT_CRY_MUONS)`` for training,
        ``slice(-HELD_OUT_CRY_MUONS, None)`` for testing.

    Raises
    ------
    RefusedError
        If the file can't be read, lacks a column, has a row that is no muon, or no muon of 1 MeV in these rows.
    """
    try:
        with h5py.File(path) as file:
            group = file["muons"]
            columns = {name: group[name] for name in CRY_COLUMNS}
            lengths = {column.shape for column in columns.values()}
            if len(lengths) > 1 or columns["charge"].ndim != 1:
                raise ValueError(f"the columns have the shapes {', '.join(map(str, sorted(lengths)))}")
            rows = slice(*part.indices(len(columns["charge"])))
            rate = float(group.attrs["rate_hz_per_m2"])
            if not 0 < rate < np.inf:
                raise ValueError(f"rate_hz_per_m2 is {rate}")
            source = str(group.attrs["source"])
            energy, u, v, w, charge = (column[rows] for column in columns.values())
            total = len(columns["charge"])
            place = numbered(path, "row", rows.start)
            with np.errstate(over="ignore"):  # beyond float32: infinite, which is refused
                muons = Muons.of(energy * np.float32(1e-3), u, v, w, pdg_id_of(charge, place))
    except READ_ERRORS as error:
        raise RefusedError(
            f"{path} is no CRY sample (HDF5, /muons with energy, direction and charge): {reason(error)}"
        ) from error
    refuse_unphysical(muons, place, tolerance=2e-6)  # as they are: released models learned from these very numbers
    kept = muons.kinetic_energy >= MINIMUM_ENERGY
    if not kept.any():
        raise RefusedError(f"{path} has no muon of at least 1 MeV in its rows {rows.start} to {rows.stop}")
    return Sample(
        muons=muons[kept],
        depth_m=0.0,
        source=source,
        provenance=(f"{source}, rows {rows.start} to {rows.stop}, {np.sum(~kept)} below 1 MeV dropped",),
        rate=rate * float(np.mean(kept)),
        rate_uncertainty=rate * float(np.sqrt(CRY_SHOWER_VARIANCE / total)),
        smoothed=False,
    )
