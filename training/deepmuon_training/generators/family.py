"""Makes a family of fitted generators, each of another depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.export.exportable import Family
from deepmuon_training.export.family_export import export_family
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import Mismatch
from deepmuon_training.families.rates import KnownRate
from deepmuon_training.generators.fitted import FittedGenerator
from deepmuon_training.generators.registry import architecture
from deepmuon_training.learning.threads import one_thread
from deepmuon_training.medium import density, model_medium

__all__ = ["FittedFamily", "check_knots", "family_of"]


@dataclass(frozen=True)
class FittedFamily:
    """A family, before it is an ONNX file.

    Parameters
    ----------
    family
        Its numbers.
    knots
        What each knot was trained on, ascending in depth.
    rates
        By which the rate of any depth is known, ascending; empty where it is not.
    notes
        What its users should know: of the family, and of its knots.
    """

    family: Family
    knots: tuple[Training, ...]
    rates: tuple[KnownRate, ...]
    notes: tuple[str, ...]

    def __str__(self) -> str:
        """Say what it is in a line."""
        top, bottom = self.knots[0], self.knots[-1]
        rate = "unknown rate"
        if self.rates:
            rate = f"{self.rates[0].rate:.2f} to {self.rates[-1].rate:.2f} muons per m2 and s"
        return (
            f"{self.family.architecture}, {len(self.knots)} knots from {top.depth_m:g} to {bottom.depth_m:g} m of "
            f"{bottom.medium}, {rate}"
        )

    @one_thread()
    def export(self, path: Path, *, overwrite: bool = False) -> Mismatch:
        """Write it as an ONNX file; raises what `deepmuon_training.export.family_export.export_family` does."""
        return export_family(self.family, self.knots, _least_certain(self.rates), path, overwrite=overwrite)


@one_thread()
def family_of(generators: Sequence[FittedGenerator], more_rates: Sequence[KnownRate] = ()) -> FittedFamily:
    """Make a family, whose knots are the generators.

    Parameters
    ----------
    generators
        Two or more, in any order, each of another depth; of one architecture, flux and medium.
    more_rates
        Rates at further depths, which the samples of the generators do not say, or at theirs, where they come first.

    Raises
    ------
    RefusedError
        If no family goes through these generators, or some rates are known and others not.
    FailedError
        If a map is not monotone.
    """
    knots = sorted(generators, key=lambda knot: knot.training.depth_m)
    trainings = tuple(knot.training for knot in knots)
    kind = architecture(knots[0].architecture)
    check_knots([knot.architecture for knot in knots], trainings)
    rates = _rates(trainings, more_rates)
    tables, notes = [], []
    for knot in knots:
        numbers, differences = kind.exportable(knot.networks, knot.training.seed)
        tables.append((knot.training.depth_m, numbers))
        notes += [f"{knot.training.depth_m:g} m: {note}" for note in (*knot.notes, *differences)]
    family = kind.family(tables, density(trainings[-1].medium), rates)
    return FittedFamily(family, trainings, rates, (*family.notes, *notes))


def check_knots(architectures: Sequence[str], trainings: Sequence[Training]) -> None:
    """Tell whether a family goes through generators, of which each is of one architecture and training.

    Raises
    ------
    RefusedError
        If there are fewer than two, or they differ in more than the depth.
    """
    if len(trainings) < 2:
        raise RefusedError(f"{len(trainings)} knot makes no family: two generators of different depths are the fewest")
    if not architecture(architectures[0]).makes_families:
        raise RefusedError(
            f"a {architectures[0]} makes no family: its muons of two depths and the same latents have nothing in common"
        )
    depths = sorted(training.depth_m for training in trainings)
    for above, below in pairwise(depths):
        if np.float32(below) == np.float32(above):
            raise RefusedError(f"two generators are of {below:g} m: a family has one knot at a depth")
    # At sea level there is no overburden, whatever its name.
    media = [model_medium(training.medium) for training in trainings if training.depth_m > 0]
    charges = [_CHARGES[training.charge] for training in trainings]
    fluxes = [training.flux or "an unknown flux" for training in trainings]
    for what, found in {"": architectures, "of ": fluxes, "under ": media, "of muons of ": charges}.items():
        different = list(dict.fromkeys(found))
        if len(different) > 1:
            raise RefusedError(
                f"some generators are {what}{different[0]}, and some {what}{different[1]}: a family's differ in depth "
                "alone"
            )


_CHARGES = {None: "both charges", -1: "charge -1", 1: "charge +1"}


def _rates(trainings: Sequence[Training], more: Sequence[KnownRate]) -> tuple[KnownRate, ...]:
    """Return the rates of knots and those of further depths, ascending."""
    low, high = (float(np.float32(training.depth_m)) for training in (trainings[0], trainings[-1]))
    known = {
        np.float32(knot.depth_m): KnownRate(knot.depth_m, knot.rate, knot.rate_uncertainty)
        for knot in trainings
        if knot.rate is not None
    }
    for one in more:
        if not low <= np.float32(one.depth_m) <= high:
            raise RefusedError(f"a rate at {one.depth_m:g} m: the generators are of {low:g} to {high:g} m")
    if len({np.float32(one.depth_m) for one in more}) < len(more):
        raise RefusedError("two rates are of one depth: give one for each")
    known |= {np.float32(one.depth_m): one for one in more}
    unknown = [f"{knot.depth_m:g} m" for knot in trainings if np.float32(knot.depth_m) not in known]
    if known and unknown:
        raise RefusedError(f"the rate is unknown at {', '.join(unknown)}, and known elsewhere: say it in --rates")
    return tuple(known[depth] for depth in sorted(known))


def _least_certain(rates: Sequence[KnownRate]) -> float | None:
    """Return the largest relative uncertainty of rates; None where one is unknown."""
    found = [None if one.uncertainty is None else one.uncertainty / one.rate for one in rates]
    return max((one for one in found if one is not None), default=None) if None not in found else None
