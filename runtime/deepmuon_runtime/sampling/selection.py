"""Muons of a source that cuts keep and that hit a target, by their numbers; and how many there are a second."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple

from deepmuon_runtime.cuts import Cuts
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import RATE_DIGITS
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.sampling.attempts import Attempts
from deepmuon_runtime.sampling.drawing import Drawing
from deepmuon_runtime.sampling.energy_cut import EnergyCut
from deepmuon_runtime.sampling.integration import Integral, integral
from deepmuon_runtime.sampling.maker import Maker
from deepmuon_runtime.sampling.source import Source
from deepmuon_runtime.targets.target import Target

if TYPE_CHECKING:
    from deepmuon_runtime.cuda.maker import DeviceMaker

__all__ = ["Rate", "Selection"]

PIECE = {"cpu": 1 << 17, "cuda": 1 << 18}
"""Muons of one task of a thread, and of one write, in whole blocks."""

OF_REJECTED = 2  # times as many where some are made again: the last rounds cost a task of any size as much


def _never() -> None:
    """Go on."""


class Rate(NamedTuple):
    """How often muons come.

    Parameters
    ----------
    hz
        Per second, and per m2 of the surface where there is no target.
    uncertainty
        Its standard uncertainty; None where the model does not know its own.
    """

    hz: float
    uncertainty: float | None


class Selection:
    """The muons of a source that cuts keep, and all of which hit a target.

    Parameters
    ----------
    source, cuts, target
        What is asked.

    Raises
    ------
    RefusedError
        If there are no such muons.
    """

    def __init__(self, source: Source, cuts: Cuts, target: Target | None) -> None:
        self.source, self.cuts, self.target = source, cuts, target
        self._check_range()
        has_levels = source.model.energy_latents is not None
        self._energy = EnergyCut(source, cuts) if cuts.cut_energy and has_levels else None
        self.rejects = (
            cuts.cut_zenith or (cuts.cut_energy and not has_levels) or (target is not None and target.rejects)
        )

    @property
    def piece(self) -> int:
        """The muons of a task, in whole blocks."""
        return self._attempts.muons if self.rejects else self._piece

    @cached_property
    def on_device(self) -> DeviceMaker | None:
        """What makes these muons in a GPU's memory; None where they come from here."""
        device = self.source.on_device
        if device is None or self.target is None or device.puts_on(self.target):
            return device
        return None

    def empty(self, n: int, *, has_time: bool = False) -> Muons:
        """Return n muons whose columns are yet to be filled."""
        has_place = self.target is not None
        if self.on_device is None:
            return Muons.empty(n, has_place=has_place, has_time=has_time)
        from deepmuon_runtime.cuda.memory import empty_on_host

        return empty_on_host(n, has_place=has_place, has_time=has_time)

    def fill(self, muons: Muons, seed: int, first: int, stopped: Callable[[], object] = _never) -> None:
        """Make the muons from number `first` on.

        Parameters
        ----------
        muons
            What is to be filled, with places where there is a target; in a GPU's memory only if they are made there.
        seed
            0 to 2^64 - 1.
        first
            Number of the first.
        stopped
            Called now and then; it may raise.

        Raises
        ------
        FailedError
            If the model gives an unphysical muon.
        """
        size = self._attempts.muons if self.rejects else self._maker.block_muons
        done = 0
        while done < len(muons):
            stopped()
            unit, skipped = divmod(first + done, size)
            part = muons[done : done + size - skipped]
            make = partial(self._make, seed, unit, skipped, stopped)
            if self.on_device is None:
                make(part)
            else:
                self.on_device.fill(part, make)
            done += len(part)

    def _make(self, seed: int, unit: int, skipped: int, stopped: Callable[[], object], muons: Muons) -> None:
        """Make muons of a unit, which is a block where none are rejected, in the memory where they are made."""
        if self.rejects:
            self._attempts.fill(muons, seed, unit, skipped, stopped)
        else:
            draws = self._maker.block_draws
            self._drawing.first(muons, seed, range(unit * draws, (unit + 1) * draws), skipped)

    @cached_property
    def share(self) -> float:
        """The share of all muons, of those that hit the target where there is one, that the cuts keep."""
        if not self.cuts:
            return 1.0
        whole = 1.0 if self.target is None else integral(self.source, Cuts(), self.target, None, _never).mean
        return min(1.0, _rounded(self._of_all.mean / whole))

    def warn_if_rarer_than(self, share: float) -> None:
        """Warn where the cuts keep less than a share of the muons."""
        if self.cuts and self.share < share:
            cost = ": each takes as many attempts" if self.rejects else ""
            warnings.warn(f"the cuts keep 1 muon in {1 / self.share:,.3g}{cost}", stacklevel=4)

    @cached_property
    def rate(self) -> Rate | None:
        """How often these muons come; None where the model does not know its rate.

        By a fixed integration over the model's latents, never by the muons of a run.
        """
        model, kept = self.source.model, self._of_all
        if model.rate_hz_per_m2 is None:
            return None
        relative, own = kept.error / kept.mean, model.rate_uncertainty_hz_per_m2
        if self.target is None and not self.cuts:
            return Rate(model.rate_hz_per_m2, own)
        hz = model.rate_hz_per_m2 * kept.mean
        uncertainty = None if own is None else hz * math.hypot(own / model.rate_hz_per_m2, relative)
        return Rate(_rounded(hz), None if uncertainty is None else float(f"{uncertainty:.3g}"))

    @cached_property
    def _of_drawn(self) -> Integral:
        """What is kept of the muons that are drawn: of all, or of those whose energies are squeezed."""
        if not self.rejects:
            return Integral(1.0 if self.target is None else self.target.largest_area, 0.0, 0)
        found = integral(self.source, self.cuts, self.target, self._energy, _never)
        if not found.mean > 0:
            raise RefusedError(
                f"the cuts keep none of {found.muons:,} muons of {self.source.model.name} that were tried: widen them"
            )
        return found

    @property
    def _of_all(self) -> Integral:
        share = 1.0 if self._energy is None else self._energy.share
        drawn = self._of_drawn
        return Integral(drawn.mean * share, drawn.error * share, drawn.muons)

    @property
    def _piece(self) -> int:
        if self.on_device is not None:
            return self.on_device.block_muons
        block = self.source.block_muons
        return -(-PIECE[self.source.device] * (OF_REJECTED if self.rejects else 1) // block) * block

    @property
    def _maker(self) -> Maker:
        return self.source if self.on_device is None else self.on_device

    @cached_property
    def _drawing(self) -> Drawing:
        return Drawing(self._maker, self.cuts, self.target, self._energy)

    @cached_property
    def _attempts(self) -> Attempts:
        largest = 1.0 if self.target is None else self.target.largest_area
        taken = self._of_drawn.mean / largest
        return Attempts(self._drawing, taken, self._piece)

    def _check_range(self) -> None:
        model, (least, most) = self.source.model, self.cuts.energies
        if least > model.energy_max_gev or most < model.energy_min_gev:
            raise RefusedError(
                f"no muon is left: those of {model.name} have kinetic energies from {model.energy_min_gev:g} to "
                f"{model.energy_max_gev:g} GeV"
            )


def _rounded(number: float) -> float:
    """Return a number that float32 arithmetic made, without the digits that go with the type of CPU."""
    return float(f"{number:.{RATE_DIGITS}g}")
