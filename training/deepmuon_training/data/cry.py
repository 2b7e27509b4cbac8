"""CRY's sea-level muons as they were made, and what is known of them."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.muon_file.columns import storage_defects
from deepmuon_runtime.muon_file.damage import READ_ERRORS, member
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import LOWEST_ENERGY
from deepmuon_training.data.conversion import warn_of_dropped
from deepmuon_training.data.foreign.muons import pdg_id_of, refuse_unphysical
from deepmuon_training.data.foreign.table import numbered
from deepmuon_training.sample import Sample

__all__ = ["CRY_SHOWER_VARIANCE", "HELD_OUT_CRY_MUONS", "read_cry"]

HELD_OUT_CRY_MUONS = 2_000_000
"""The last so many muons of the CRY sample test the generators; none of them ever trains one."""

CRY_VARIANCE_FACTOR = 1.17
"""Largest variance of the number of muons below an energy, among a fixed number of all, in units of a binomial one's.

In the last 2,000,000 muons, in blocks of 200 (+- 0.014): 1.01, 1.03, 1.11, 1.17, 1.15 for the 5, 25, 50, 75 and 95 %
quantiles of the energy, since showers have energies of their own; 1.05 at most for cos zenith; 1.00 within noise
for azimuth and charge.
"""

CRY_SHOWER_VARIANCE = 2.10
"""Variance of the number of CRY's muons, in units of Poisson's.

Muons of one shower come together, so their number varies by more than its square root: its variance is <m^2> / <m>
times as large, m being the muons of a shower in CRY's 100 m box. Measured with CRY 1.7 on 120,000,000 muons; the
scatter of the rates of 44 runs of 1,000,000 and 4,000,000 agrees.
"""

CRY_COLUMNS = ("kinetic_energy", "u", "v", "w", "charge")


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
        if Path(path).exists() and not Path(path).is_file():
            raise ValueError("it is a folder, a pipe or a device")
        with h5py.File(path) as file:
            columns = {name: _column(file, name) for name in CRY_COLUMNS}
            group = file["muons"]
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
    kept = muons.kinetic_energy >= LOWEST_ENERGY
    if not kept.any():
        raise RefusedError(f"{path} has no muon of at least 1 MeV in its rows {rows.start} to {rows.stop}")
    warn_of_dropped(int(np.sum(~kept)), len(kept), "MeV")
    return Sample(
        muons=muons[kept],
        depth_m=0.0,
        source=source,
        provenance=(f"{source}, rows {rows.start} to {rows.stop}, {np.sum(~kept)} below 1 MeV dropped",),
        rate=rate * float(np.mean(kept)),
        rate_uncertainty=rate * float(np.sqrt(CRY_SHOWER_VARIANCE / total)),
        smoothed=False,
        variance_factor=CRY_VARIANCE_FACTOR,
        flux="cry",
    )


def _column(file: h5py.File, name: str) -> h5py.Dataset:
    """Return a column that is stored in the file itself, and whole."""
    column = member(file, f"muons/{name}")
    if not isinstance(column, h5py.Dataset):
        raise ValueError(f"there is no column {name}")
    for defect in storage_defects(column):
        raise ValueError(f"the column {name} {defect}")
    return column
