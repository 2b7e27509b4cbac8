"""Fits the `quantile` generator: densities of energy and zenith, the charge, and the azimuth where it is learned."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import logit

from deepmuon_runtime.muons import Muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.generators.quantile.azimuth_fit import AZIMUTH_SCHEDULE, fit_azimuth
from deepmuon_training.generators.quantile.cells import row_logits
from deepmuon_training.generators.quantile.maps import QuantileGenerator, inclination
from deepmuon_training.learning.descent import Schedule
from deepmuon_training.learning.splines import Axis, Surface, fit_log_density, fit_logit
from deepmuon_training.learning.support import Support
from deepmuon_training.progress import progress_bar

__all__ = ["QuantileSettings", "fit_quantile"]

_ENERGIES = 128
"""Intervals between knots of ln E."""

_MOST_OF_EACH = 40
"""Intervals between knots of the logit of the energy's level, and of the inclination: the fourth root of the number of
muons, so that a square between them holds as many muons as there are squares, but no more than this."""

_BEYOND = 0.5
"""How much farther than the muons knots reach, of the muons' range: that there are none is known, too."""

_OUTERMOST = 200
"""Muons at either end of the spectrum that share one distribution of angles."""

_FLATTEST = 1e-3
"""Cosine of the zenith angle where the knots end at the latest."""

_STEEPEST = 1 - 1e-12
"""And at the earliest."""

_CONSTANT = Axis(0.0, 1.0, 0)

Float = NDArray[np.float64]


@dataclass(frozen=True)
class QuantileSettings:
    """What a fit can be told; the default made the released models.

    Parameters
    ----------
    azimuth
        How the azimuth's network is trained, where it is learned.
    """

    azimuth: Schedule = AZIMUTH_SCHEDULE


def fit_quantile(
    muons: Muons,
    *,
    seed: int,
    settings: QuantileSettings | None = None,
    learn_azimuth: bool = False,
    support: Support | None = None,
    checkpoint_folder: Path | None = None,
    progress: bool = True,
) -> QuantileGenerator:
    """Fit a generator to muons.

    Parameters
    ----------
    muons
        Independent muons in no particular order.
    seed
        Of the azimuth's network: nothing else is random.
    settings
        Of the same.
    learn_azimuth
        Whether the azimuth's density is learned; else it is uniform.
    support
        Where muons can be; if left out, what `Support.of` finds.
    checkpoint_folder
        Existing folder for the checkpoint azimuth.pt, see `deepmuon_training.learning.descent.fit`.
    progress
        Whether to show progress bars.
    """
    support = support or Support.of(muons)
    transform = EnergyTransform.fit(muons.kinetic_energy)
    azimuth = None
    if learn_azimuth:
        azimuth = fit_azimuth(
            muons,
            transform,
            seed=seed,
            schedule=(settings or QuantileSettings()).azimuth,
            checkpoint=checkpoint_folder and checkpoint_folder / "azimuth.pt",
            progress=progress,
        )
    with progress_bar(3, "energy, zenith, charge", " maps", hidden=not progress) as bar:
        log_energy = np.log(muons.kinetic_energy.astype(np.float64))
        energy_range = support.energy_min, support.energy_max
        energy = _fit_energy(log_energy, energy_range)
        bar.update()
        known = QuantileGenerator(transform, energy, energy, 0, energy_range)
        x = inclination(_cos_zenith_logit(muons))
        cells = _Cells.of(known.energy_logit(log_energy), x, support.cos_zenith_min)
        everything = cells.count()
        exposure = everything.sum(axis=1, keepdims=True) * np.diff(cells.axes[1].edges)
        zenith = fit_log_density(cells.axes, everything, exposure)
        bar.update()
        charge = support.charge or fit_logit(cells.axes, cells.count(muons.charge > 0), everything)
        bar.update()
    return QuantileGenerator(transform, energy, zenith, charge, energy_range, support.cos_zenith_min, azimuth)


def _fit_energy(log_energy: Float, energy_range: tuple[float, float]) -> Surface:
    """Fit the density of ln E/GeV [n]."""
    low, high = float(log_energy.min()), float(log_energy.max())
    beyond = _BEYOND * (high - low)
    least, largest = np.log(energy_range).tolist()
    axis = Axis(max(low - beyond, least), min(high + beyond, largest), _ENERGIES)
    counts = np.bincount(axis.bin_of(log_energy), minlength=axis.bins)[:, None].astype(np.float64)
    exposure = len(log_energy) * np.diff(axis.edges)[:, None]
    return fit_log_density((axis, _CONSTANT), counts, exposure)


@dataclass(frozen=True)
class _Cells:
    """Where muons are counted: in bins of the logit of the energy's level, and of the inclination."""

    axes: tuple[Axis, Axis]
    number: NDArray[np.intp]

    @classmethod
    def of(cls, t: Float, x: Float, cos_zenith_min: float) -> _Cells:
        """Find the cells of muons by their t [n] and x [n]."""
        reach = min(float(row_logits()[-1]), float(np.log(len(t) / _OUTERMOST)))
        horizontal = float(inclination(np.array(logit(min(max(cos_zenith_min, _FLATTEST), _STEEPEST)))))
        farthest = (1 + _BEYOND) * float(x.max())
        each = min(round(len(t) ** 0.25), _MOST_OF_EACH)
        axes = Axis(-reach, reach, each), Axis(0.0, min(farthest, horizontal), each)
        return cls(axes, axes[0].bin_of(t) * axes[1].bins + axes[1].bin_of(x))

    def count(self, which: NDArray[np.bool_] | slice = slice(None)) -> Float:
        """Count muons, or some of them."""
        bins = [axis.bins for axis in self.axes]
        return np.bincount(self.number[which], minlength=bins[0] * bins[1]).reshape(bins).astype(np.float64)


def _cos_zenith_logit(muons: Muons) -> Float:
    """Logit of cos zenith; 1 - cos zenith comes from the horizontal components, without a cancellation."""
    c = np.clip(muons.cos_zenith.astype(np.float64), 1e-6, 1)
    sine_squared = np.maximum(muons.u.astype(np.float64) ** 2 + muons.v.astype(np.float64) ** 2, 1e-12)
    found: Float = np.log(c * (1 + c) / sine_squared)
    return found
