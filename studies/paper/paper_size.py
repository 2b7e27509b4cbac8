"""The paper's own size of network, d = 1024, beside the released models.

    deepmuon-train fit training-0m.h5 --architecture transformer -d 1024 --settings models/paper_size.toml -o paper.pt
    deepmuon-train export paper.pt -o paper.onnx
    python -m studies.paper.paper_size paper.onnx --held-out testing-0m.h5

`models/make.py` leaves both samples in WORK/samples.
"""

from __future__ import annotations

from pathlib import Path

import click

from deepmuon_runtime import Generator, read_muons
from studies.shared.judged import GENERATED, scores_of, table
from studies.shared.options import FILE
from studies.shared.report import write


@click.command(help=__doc__)
@click.argument("model", type=FILE)
@click.option("--held-out", required=True, type=FILE, help="Smoothed CRY muons that did not train.")
def main(model: Path, held_out: Path) -> None:
    """Judge the file, and the released models by the same muons."""
    truth = read_muons(held_out)
    generators = {
        ("transformer", "1024"): Generator.open(file=model, device="cpu"),
        ("transformer", "128"): Generator.open(0, architecture="transformer"),
        ("quantile", ""): Generator.open(0, architecture="quantile"),
    }
    results = {key: scores_of(generator, truth) for key, generator in generators.items()}
    numbers = [{"architecture": key[0], "d": key[1], "scores": of} for key, of in results.items()]
    rows = table(("architecture", "d"), results)
    write(Path(__file__), {"held_out": len(truth), "generated": GENERATED, "results": numbers}, rows)


if __name__ == "__main__":
    main()
