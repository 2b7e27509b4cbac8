"""Compares every engine that is here with PyTorch and writes engines.md: ``python -m studies.benchmark.engines``."""

from __future__ import annotations

import sys
from pathlib import Path

from studies.shared.processes import REPOSITORY
from studies.shared.report import table

sys.path.insert(0, str(REPOSITORY / "tests"))

from support.engines import ENGINES, MODELS, Engine, difference, expected

ARCHITECTURES = sorted({model.stem.split("-")[0] for model in MODELS})


def main() -> None:
    """Run all models in all engines, and write the table."""
    headings = ["engine", "package"]
    for architecture in ARCHITECTURES:
        headings += [f"`{architecture}`: energy", "direction", "charges"]
    rows = [headings, *([name, *row(engine)] for name, engine in ENGINES.items())]
    text = table(rows, text_columns=2)
    Path(__file__).with_suffix(".md").write_text(text, encoding="utf-8")
    print(text)


def row(engine: Engine) -> list[str]:
    """Return the package with its version, and the largest differences over the models of each architecture."""
    if engine.missing():
        return [engine.package, *["not tried"] * 3 * len(ARCHITECTURES)]
    cells = [f"{engine.package} {engine.version()}"]
    for architecture in ARCHITECTURES:
        models = [model for model in MODELS if model.stem.startswith(architecture)]
        seen = [difference(engine.run(model), expected(model)) for model in models]
        energy, direction, charges = (max(column) for column in zip(*seen, strict=True))
        cells += [f"{energy:.1e}", f"{direction:.1e}", str(charges)]
    return cells


if __name__ == "__main__":
    main()
