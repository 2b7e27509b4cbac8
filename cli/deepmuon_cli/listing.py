"""The released models as a table, for a terminal of 80 columns and more."""

from __future__ import annotations

from collections.abc import Iterator

from deepmuon_runtime import Model
from deepmuon_runtime.model.released import (
    DEFAULT_FLUX,
    DEFAULT_MEDIUM,
    default_architecture,
    list_models,
    serving_models,
)

__all__ = ["listing"]

HEADS = ("architecture", "flux", "medium", "depth/m", "rate/(1/m2/s)", "trained on", "muons/draw", "size/kB")
NAMES = 3  # columns of words; the others are of numbers


def listing() -> Iterator[str]:
    """Yield the lines of the table, and what is to be said of it."""
    models = list_models()
    default, serving = (default_architecture(), DEFAULT_FLUX, DEFAULT_MEDIUM), serving_models()
    taken = [model for model in serving if (model.architecture, model.flux, model.medium) == default]
    rows = [HEADS, *(_row(model, "*" if model in taken else "") for model in models)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = enumerate(zip(row, widths, strict=True))
        yield "  ".join(text.ljust(width) if place < NAMES else text.rjust(width) for place, (text, width) in cells)
    yield "* taken where nothing but a depth is named"
    if any(model.is_family for model in models):
        yield "A family serves each depth of its range; files of one depth within it are for programs of your own."


def _row(model: Model, mark: str) -> tuple[str, ...]:
    rate = "unknown" if model.rate_hz_per_m2 is None else f"{model.rate_hz_per_m2:.2f}"
    muons = model.metadata.get("training_muons")
    return (
        model.architecture + mark,
        model.flux,
        model.medium,
        model.depths,
        "of the depth" if model.is_family else rate,
        "unknown" if muons is None else f"{int(muons):,}",
        str(model.muons_per_draw),
        f"{model.size / 1e3:.0f}",
    )
