"""A muon sample: muons at one depth, with what is known of where they come from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import HORIZONTAL_PLANE
from deepmuon_runtime.muon_file.place_and_time import cuts_of
from deepmuon_runtime.muon_file.reader import read_attributes, read_muons
from deepmuon_runtime.muon_file.writer import write_muons
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.targets.plane import Plane
from deepmuon_training.medium import geant4_medium

__all__ = [
    "Sample",
    "read_sample",
    "sample_of",
    "write_sample",
]


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
        Muons per second and m2 of the plane, and its statistical standard uncertainty; None where unknown.
    smoothed : bool or None
        Whether the generator's histogram steps were taken out.
    variance_factor : float or None
        How many times larger than of independent muons the variance of counts is: above 1 where muons come in showers;
        None where nobody said.
    flux : str or None
        Name of the flux at the surface, `cry` for instance; None where nobody said.
    """

    muons: Muons
    depth_m: float
    source: str
    provenance: tuple[str, ...] = ()
    medium: str = "G4_WATER"
    rate: float | None = None
    rate_uncertainty: float | None = None
    smoothed: bool | None = None
    variance_factor: float | None = None
    flux: str | None = None

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
            "variance_factor": self.variance_factor,
            "flux": self.flux,
        }
        return {name: value for name, value in attributes.items() if value is not None}


def read_sample(path: str | Path, first: int = 0, count: int | None = None) -> Sample:
    """Read a sample, or a part of it, from a muon file. The whole of it is verified by its checksums, a part can't be.

    Parameters
    ----------
    path
        The file.
    first, count
        Which muons, as in `deepmuon_runtime.read_muons`; all if left out.

    Raises
    ------
    RefusedError
        If the file is no muon file or a damaged one, does not hold the muons asked for, or its muons came through a
        sphere or into a body: they are no plane's.
    """
    return sample_of(read_muons(path, first, count), read_attributes(path), path)


def sample_of(muons: Muons, attributes: Mapping[str, Any], path: str | Path) -> Sample:
    """Return muons with what the attributes of a muon file, which lies under a path or could, say of them.

    Raises
    ------
    RefusedError
        If they say that the muons came through a sphere or into a body.
    """
    if (
        attributes.get("surface", HORIZONTAL_PLANE) != HORIZONTAL_PLANE
        or attributes.get("target", Plane.name) != Plane.name
    ):
        what = f"that hit a {attributes['target']}" if "target" in attributes else "through a sphere"
        raise RefusedError(f"{path} has muons {what}, and a sample's cross a horizontal plane: make it without a body")
    rate, uncertainty = attributes.get("rate_hz_per_m2"), attributes.get("rate_uncertainty_hz_per_m2")
    if attributes.get("target") == Plane.name and "target_size_m" in attributes:
        area = math.prod(attributes["target_size_m"])
        names = ("target_rate_hz", "target_rate_uncertainty_hz")
        rate, uncertainty = (attributes[name] / area if name in attributes else None for name in names)
    smoothed, variance_factor = attributes.get("smoothed"), attributes.get("variance_factor")
    flux = attributes.get("flux")
    cuts = ", ".join(f"{name} {bound:g}" for name, bound in cuts_of(attributes).attributes.items())
    return Sample(
        muons=muons,
        depth_m=float(attributes["depth_m"]),
        source=str(attributes.get("source") or attributes["created_by"]),
        provenance=(*map(str, attributes.get("provenance", ())), *([f"cut: {cuts}"] if cuts else [])),
        medium=geant4_medium(str(attributes["medium"])),
        rate=None if rate is None else float(rate),
        rate_uncertainty=None if uncertainty is None else float(uncertainty),
        smoothed=None if smoothed is None else bool(smoothed),
        variance_factor=None if variance_factor is None else float(variance_factor),
        flux=None if flux is None else str(flux),
    )


def write_sample(path: str | Path, sample: Sample, *, overwrite: bool = False) -> None:
    """Write a sample as a muon file.

    Raises
    ------
    RefusedError
        If the file exists (without `overwrite`) or can't be written.
    """
    write_muons(path, sample.muons, sample.attributes, overwrite=overwrite)
