"""The azimuth of generated muons against that of held-out ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import Muons
from deepmuon_training.scores.chi_square import ChiSquare

__all__ = ["AzimuthScore", "Harmonic", "compare_azimuth", "harmonic_moments", "in_ranges"]

_HARMONICS = 4
_RANGES = {"below 1 GeV": (0.0, 1.0), "1 to 10 GeV": (1.0, 10.0), "above 10 GeV": (10.0, inf)}
_FEWEST = 1000  # muons of a sample under which an energy range is left out
_CHUNK = 1 << 20

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Harmonic:
    """Amplitudes of one harmonic, A_k of 1 + A_k cos(k azimuth + phase), ``A_k = 2 |mean exp(i k azimuth)|``.

    `difference` is the amplitude of the difference of the two modulations, and `noise` its root mean
    square where both samples are alike (2 sqrt(1/n + 1/m) for a uniform azimuth).
    """

    order: int
    generated: float
    held_out: float
    difference: float
    noise: float


@dataclass(frozen=True)
class AzimuthScore:
    """Harmonics 1 to 4 by energy range, and one chi-square of all their differences.

    The azimuth is that of the direction of motion, from the x to the y axis. Assumes independent muons.
    """

    harmonics: dict[str, tuple[Harmonic, ...]]
    chi_square: ChiSquare


def in_ranges(muons: Muons) -> Iterator[tuple[str, Muons]]:
    """Yield the muons below 1 GeV, from 1 to 10 GeV, and above, with the range's name, where there are 1000.

    Vertical ones, which have no azimuth, are left out.
    """
    inclined = (muons.u != 0) | (muons.v != 0)
    for name, (low, high) in _RANGES.items():
        part = muons[inclined & (muons.kinetic_energy >= low) & (muons.kinetic_energy < high)]
        if len(part) >= _FEWEST:
            yield name, part


def harmonic_moments(muons: Muons) -> tuple[int, Float, Float]:
    """Find number, mean [8] and covariance [8, 8] of cos(k azimuth), sin(k azimuth), k = 1 to 4, of inclined muons."""
    number, first, second = 0, np.zeros(2 * _HARMONICS), np.zeros((2 * _HARMONICS,) * 2)
    for start in range(0, len(muons), _CHUNK):
        part = muons[start : start + _CHUNK]
        direction = part.u + 1j * part.v.astype(np.float64)
        phase = direction / np.abs(direction)
        powers = np.stack([phase**k for k in range(1, _HARMONICS + 1)])
        waves = np.concatenate([powers.real, powers.imag])
        number += waves.shape[1]
        first += waves.sum(axis=1)
        second += waves @ waves.T
    mean = first / max(number, 1)
    return number, mean, second / max(number, 1) - np.outer(mean, mean)


def _compare_range(generated: Muons, held_out: Muons) -> tuple[tuple[Harmonic, ...], ChiSquare]:
    """Harmonics of one energy range and Hotelling's T^2 of their differences."""
    n, mean_p, covariance_p = harmonic_moments(generated)
    m, mean_q, covariance_q = harmonic_moments(held_out)
    difference = mean_p - mean_q
    noise = (n * covariance_p + m * covariance_q) / (n + m) * (1 / n + 1 / m)

    def amplitude(mean: Float, k: int) -> float:
        return float(2 * np.hypot(mean[k], mean[k + _HARMONICS]))

    harmonics = tuple(
        Harmonic(
            order=k + 1,
            generated=amplitude(mean_p, k),
            held_out=amplitude(mean_q, k),
            difference=amplitude(difference, k),
            noise=2 * sqrt(noise[k, k] + noise[k + _HARMONICS, k + _HARMONICS]),
        )
        for k in range(_HARMONICS)
    )
    chi2 = float(difference @ np.linalg.pinv(noise, hermitian=True) @ difference)
    return harmonics, ChiSquare.of(chi2, int(np.linalg.matrix_rank(noise, hermitian=True)))


def compare_azimuth(generated: Muons, held_out: Muons) -> AzimuthScore:
    """Compare the azimuth's harmonics 1 to 4 below 1 GeV, from 1 to 10 GeV, and above.

    A range with fewer than 1000 muons in either sample is left out.
    """
    harmonics, chi2, ndf = {}, 0.0, 0
    ranges = dict(in_ranges(held_out))
    for name, part in in_ranges(generated):
        if name in ranges:
            harmonics[name], chi_square = _compare_range(part, ranges[name])
            chi2, ndf = chi2 + chi_square.chi2, ndf + chi_square.ndf
    return AzimuthScore(harmonics, ChiSquare.of(chi2, ndf))
