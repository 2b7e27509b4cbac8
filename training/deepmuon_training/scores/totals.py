"""Scores of a sample as a whole: unphysical muons, rate, charge ratio."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import MU_PLUS, Muons
from deepmuon_runtime.physical import Fault, find_unphysical

__all__ = [
    "ChargeRatio",
    "Rate",
    "RateScore",
    "UnphysicalMuons",
    "compare_charge_ratio",
    "compare_rate",
    "count_unphysical",
    "is_physical",
]


Rate = tuple[float, float | None]
"""A rate and its statistical standard uncertainty [Hz/m2], None where that is unknown."""


@dataclass(frozen=True)
class UnphysicalMuons:
    """Muons that can't be, by reason; one muon may have several.

    `fraction` is of muons with any. `fraction_before_mapping` is of the generator's muons before its graph
    mapped them to physical ones, None where nobody said.
    """

    energy_out_of_range: int
    not_of_unit_length: int
    not_downward: int
    unknown_charge: int
    fraction: float
    fraction_before_mapping: float | None


@dataclass(frozen=True)
class RateScore:
    """Rates [Hz/m2] with their statistical errors, and their difference in its error.

    An error is None where nobody stated one, and so is then the difference; it is 0 for two equal exact rates.
    """

    generated: float
    generated_error: float | None
    held_out: float
    held_out_error: float | None
    sigma: float | None


@dataclass(frozen=True)
class ChargeRatio:
    """mu+ for each mu-, R, with error R sqrt(1/mu+ + 1/mu-); None where a charge is absent.

    `sigma` is the difference of the mu+ fractions in the error of both being one.
    """

    generated: float | None
    generated_error: float | None
    held_out: float | None
    held_out_error: float | None
    sigma: float


def is_physical(muons: Muons, energy_range: tuple[float, float]) -> NDArray[np.bool_]:
    """Tell muons that can be: bool [n]. Energies [GeV] include the ends of the range."""
    return ~_any(find_unphysical(muons, *energy_range), len(muons))


def count_unphysical(
    muons: Muons, energy_range: tuple[float, float], fraction_before_mapping: float | None = None
) -> UnphysicalMuons:
    """Count muons out of the energy range [GeV], not of unit length, not downward, or of no muon's charge.

    Lengths are good to 1e-6. NaN and infinite values count as defects.
    """
    found = find_unphysical(muons, *energy_range)
    counts = {fault: int(np.count_nonzero(bad)) for fault, bad in found.items()}
    return UnphysicalMuons(
        energy_out_of_range=counts.get(Fault.ENERGY, 0),
        not_of_unit_length=counts.get(Fault.LENGTH, 0),
        not_downward=counts.get(Fault.UPWARD, 0),
        unknown_charge=counts.get(Fault.CHARGE, 0),
        fraction=float(np.mean(_any(found, len(muons)))),
        fraction_before_mapping=fraction_before_mapping,
    )


def _any(faults: dict[Fault, NDArray[np.bool_]], muons: int) -> NDArray[np.bool_]:
    has_any: NDArray[np.bool_] = np.logical_or.reduce(list(faults.values())) if faults else np.zeros(muons, np.bool_)
    return has_any


def compare_rate(generated: Rate, held_out: Rate) -> RateScore:
    """Compare two rates, each with its statistical standard uncertainty [Hz/m2], or None where that is unknown."""
    difference = generated[0] - held_out[0]
    if generated[1] is None or held_out[1] is None:
        return RateScore(*generated, *held_out, None)
    error = hypot(generated[1], held_out[1])
    sigma = difference / error if error > 0 else (0.0 if difference == 0 else None)
    return RateScore(*generated, *held_out, sigma)


def _ratio(plus: int, minus: int) -> tuple[float | None, float | None]:
    if not (plus and minus):
        return None, None
    return plus / minus, plus / minus * sqrt(1 / plus + 1 / minus)


def compare_charge_ratio(generated: Muons, held_out: Muons) -> ChargeRatio:
    """Compare mu+ / mu- of two samples of independent muons."""
    n, m = len(generated), len(held_out)
    p, q = (int(np.count_nonzero(sample.pdg_id == MU_PLUS)) for sample in (generated, held_out))
    f = (p + q) / (n + m)
    error = sqrt(f * (1 - f) * (1 / n + 1 / m))
    return ChargeRatio(*_ratio(p, n - p), *_ratio(q, m - q), (p / n - q / m) / error if error > 0 else 0.0)
