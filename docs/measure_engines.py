"""Compares every engine that is here with PyTorch and writes docs/engines.md: ``python docs/measure_engines.py``."""

from __future__ import annotations

import sys
from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
sys.path.insert(0, str(REPOSITORY / "tests"))

from support.engines import ENGINES, MODELS, Engine, difference, expected  # noqa: E402

ARCHITECTURES = sorted({model.stem.split("-")[0] for model in MODELS})


def main() -> None:
    """Run all models in all engines, and write the table."""
    headings = ["engine", "package"]
    for architecture in ARCHITECTURES:
        headings += [f"`{architecture}`: energy", "direction", "charges"]
    table = [headings, ["---", "---", *["--:"] * (len(headings) - 2)]]
    table += [[name, *row(engine)] for name, engine in ENGINES.items()]
    text = "".join(f"| {' | '.join(cells)} |\n" for cells in table)
    (REPOSITORY / "docs" / "engines.md").write_text(text, encoding="utf-8")
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
