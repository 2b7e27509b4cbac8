"""Pictures of the flux `measured`: against what was measured, and its zenith angles and slow muons."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_training.fluxes.ecomug import ecomug
from deepmuon_training.fluxes.energy_loss import ionisation_loss
from deepmuon_training.fluxes.flux import MUON_MASS, Intensity
from deepmuon_training.fluxes.gccly import gccly
from deepmuon_training.reports.pictures import STYLE
from studies.measured_flux.data import BESS_COSINE, L3, Bess, read_bess, read_l3
from studies.shared.report import COLOURS

__all__ = ["draw_fit", "draw_shape"]

BLUE, RED, GREEN, BROWN, *_, GREY = COLOURS

Float = NDArray[np.float64]


def _by_momentum(flux: Intensity, momentum: Float, cos_zenith: float) -> Float:
    """Both charges, per GeV/c."""
    total = np.hypot(momentum, MUON_MASS)
    both: Float = np.add(*flux(total - MUON_MASS, np.asarray(cos_zenith))) * momentum / total
    return both


def draw_fit(flux: Intensity) -> Figure:
    """Draw spectrum, its ratio to what was measured, and the charge ratio, over the momentum."""
    bess, l3 = read_bess(), read_l3()
    with rc_context(STYLE):
        figure = Figure(figsize=(7, 8.5), layout="constrained")
        spectrum, ratio, charge = figure.subplots(3, sharex=True, height_ratios=(4, 3, 3))
        _draw_spectrum(spectrum, flux, bess, l3)
        _draw_ratio(ratio, flux, bess, l3)
        _draw_charge(charge, flux, bess, l3)
        charge.set(xscale="log", xlim=(0.5, 4000), xlabel="momentum p [GeV/c]")
        figure.align_ylabels()
    return figure


def _draw_spectrum(axes: Axes, flux: Intensity, bess: Bess, l3: L3) -> None:
    momentum = np.geomspace(0.5, 4000, 400)
    axes.plot(momentum, momentum**3 * _by_momentum(flux, momentum, 1.0), color=BLUE, label="measured, vertical")
    axes.plot(
        momentum, momentum**3 * _by_momentum(flux, momentum, BESS_COSINE), ":", color=BLUE, label="at cos zenith 0.95"
    )
    others = (("gccly", gccly().intensity, GREEN), ("ecomug", ecomug().intensity, BROWN))
    for name, other, colour in others:
        axes.plot(momentum, momentum**3 * _by_momentum(other, momentum, 1.0), "--", color=colour, lw=0.9, label=name)
    total, error = bess.flux.sum(axis=0), np.hypot(*bess.error)
    axes.errorbar(
        bess.mean, bess.mean**3 * total, bess.mean**3 * error, fmt="o", ms=2.5, color="black", label="BESS-TeV"
    )
    axes.errorbar(l3.mean, l3.mean**3 * l3.flux, l3.mean**3 * l3.error, fmt="s", ms=3, color=RED, label="L3+C")
    axes.set(yscale="log", ylabel=r"$p^3 J$  [(GeV/c)$^2$ / (m$^2$ s sr)]", ylim=(3, 6000))
    axes.legend(loc="lower right")


def _draw_ratio(axes: Axes, flux: Intensity, bess: Bess, l3: L3) -> None:
    expected, total = bess.predicted(flux).sum(axis=0), bess.flux.sum(axis=0)
    axes.errorbar(bess.mean, total / expected, np.hypot(*bess.error) / expected, fmt="o", ms=2.5, color="black")
    expected, _ = l3.predicted(flux)
    axes.errorbar(l3.mean, l3.flux / expected, l3.error / expected, fmt="s", ms=3, color=RED)
    axes.axhline(1, color=BLUE)
    axes.set(ylabel="to the fit", ylim=(0.7, 1.3))


def _draw_charge(axes: Axes, flux: Intensity, bess: Bess, l3: L3) -> None:
    momentum = np.geomspace(0.5, 4000, 400)
    energy = np.hypot(momentum, MUON_MASS) - MUON_MASS
    for cosine, style in ((1.0, "-"), (0.5, "--"), (0.1, ":")):
        label = "vertical" if cosine == 1 else f"at cos zenith {cosine}"
        axes.plot(momentum, np.divide(*flux(energy, np.asarray(cosine))), style, color=BLUE, label=label)
    ratio = bess.flux[0] / bess.flux[1]
    axes.errorbar(bess.mean, ratio, ratio * np.hypot(*(bess.error / bess.flux)), fmt="o", ms=2.5, color="black")
    axes.errorbar(l3.mean[: len(l3.ratio)], l3.ratio, l3.ratio_error, fmt="s", ms=3, color=RED)
    axes.set(ylabel=r"$\mu^+ / \mu^-$", ylim=(1.0, 1.6))
    axes.legend(loc="upper left")


def draw_shape(flux: Intensity) -> Figure:
    """Draw zenith angles at some energies, and the flux of slow muons times the energy loss."""
    cosine = np.linspace(0, 1, 400)
    with rc_context(STYLE):
        figure = Figure(figsize=(9, 3.8), layout="constrained")
        angles, slow = figure.subplots(1, 2)
        for energy, colour in ((0.1, GREY), (1.0, BLUE), (10.0, GREEN), (100.0, BROWN), (1000.0, RED)):
            for one, style in ((flux, "-"), (gccly().intensity, ":")):
                shape = np.add(*one(np.asarray(energy), cosine)) / np.add(*one(np.asarray(energy), np.asarray(1.0)))
                label = f"{energy:g} GeV" if style == "-" else None
                angles.plot(cosine, shape, style, color=colour, label=label)
        angles.set(yscale="log", ylim=(1e-4, 6), xlabel="cos zenith", ylabel="J relative to vertical muons")
        angles.legend(loc="lower right", ncols=2, title="measured; dotted: gccly")
        slow_energy = np.geomspace(1e-3, 10, 300)
        for name, one, colour in (
            ("measured", flux, BLUE),
            ("gccly", gccly().intensity, GREEN),
            ("ecomug", ecomug().intensity, BROWN),
        ):
            stopping = 1e3 * np.add(*one(slow_energy, np.asarray(1.0))) * ionisation_loss(slow_energy)
            slow.plot(slow_energy, stopping, color=colour, label=name)
        slow.set(xscale="log", yscale="log", xlabel="kinetic energy E [GeV]")
        slow.set(ylabel=r"J S  [MeV cm$^2$/g / (m$^2$ s sr GeV)], vertical", ylim=(3, 300))
        slow.legend(loc="lower left")
    return figure
