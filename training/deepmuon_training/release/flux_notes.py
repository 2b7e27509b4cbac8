"""What a card says of the flux that a model was trained on: whose it is, and what it does not know."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FluxNotes", "flux_notes"]

_ALWAYS = (
    "Single muons: no bundles of one shower.",
    "Near the horizon few muons were there to learn from: look at the scores of cos zenith below 0.2.",
)


@dataclass(frozen=True)
class FluxNotes:
    """What is said of a flux.

    Parameters
    ----------
    credit
        Whose work it is.
    limits
        What no model trained on it knows.
    """

    credit: str
    limits: tuple[str, ...]


_KNOWN = {
    "cry": FluxNotes(
        "CRY is by Lawrence Livermore National Laboratory (UCRL-CODE-227323, BSD-style licence).",
        (
            *_ALWAYS,
            "Geant4's muon-nuclear interaction is left out; the overburden is a flat, laterally infinite slab of fresh "
            "water.",
            "CRY's flux is 16 % below what BESS-TeV measured near the vertical; its charge ratio is 1.07 at sea level, "
            "falling with energy and depth, instead of 1.2 and rising; no east-west effect, and one date and latitude.",
            "The rate's uncertainty is statistical. What is systematic is far more: 15 % of the flux at sea level; "
            "0.2 % at 50 m and 5 % at 1000 m for the muon-nuclear interaction.",
        ),
    ),
    "measured": FluxNotes(
        "The flux is a formula fitted to what BESS-TeV (Phys. Lett. B 594 (2004) 35) and L3+C (Phys. Lett. B 598 "
        "(2004) 15) measured. Muons were carried by mulder (V. Niess, LGPL-3; arXiv:2206.01457).",
        (
            *_ALWAYS,
            "The overburden is flat and laterally infinite; rock is standard rock.",
            "The flux of two experiments, each at its time: no latitude, season or solar cycle, no east-west effect; "
            "slanting muons are fitted to no measurement; above 3 TeV it is an extrapolation.",
            "The rate's uncertainty is statistical. What is systematic is far more: 7 % at sea level, and from 0.7 to "
            "6 km w.e. measured vertical intensities are 0.9 to 1.4 times these.",
        ),
    ),
}


def flux_notes(flux: str | None) -> FluxNotes:
    """Return what is said of a flux by its name; of a stranger's only what holds for all."""
    unknown = FluxNotes("The muons are of a flux of its own." if flux is None else f"The flux is {flux}.", _ALWAYS)
    return _KNOWN.get(flux or "", unknown)
