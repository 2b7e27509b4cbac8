"""The benchmark's chart: muons per second of each contestant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from studies.benchmark.contestants import DEFAULT, OLD, SAMPLE

__all__ = ["draw"]

OWN, LIMIT, OTHER = "#1f4e9e", "#bbbbbb", "#c1272d"
OURS = (DEFAULT, SAMPLE, "library", "transformer")


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the rows of a report as bars, the fastest on top, each with the range of its repetitions."""
    rows = sorted(rows, key=lambda row: row["muons_per_second"])
    rates = [row["muons_per_second"] for row in rows]
    low = [rate - row["muons"] / max(row["seconds"]) for rate, row in zip(rates, rows, strict=True)]
    high = [row["muons"] / min(row["seconds"]) - rate for rate, row in zip(rates, rows, strict=True)]
    figure = Figure(figsize=(8, 0.4 * len(rows) + 1), layout="constrained")
    axes = figure.subplots()
    axes.barh([row["name"] for row in rows], rates, color=[colour(row["name"]) for row in rows], xerr=[low, high])
    for place, rate in enumerate(rates):
        axes.annotate(
            f" {rate / 1e6:.3g} million/s", (rate, place), xytext=(6, 0), textcoords="offset points", va="center"
        )
    axes.set(xscale="log", xlim=(min(rates) / 2, max(rates) * 6), xlabel="muons per second, all cores")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110)


def colour(name: str) -> str:
    """Return the colour of a contestant's bar."""
    if name.startswith("limit"):
        return LIMIT
    return OWN if name.startswith(OURS) and not name.endswith(OLD) else OTHER
