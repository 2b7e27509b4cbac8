"""Try faults, damaged files and repetitions at random, for as long as you like: docs/trust.md, repeated.

    python -m studies.trust.run --hours 1 --seed 1

The campaigns take turns; each try has random numbers of its own, which follow from the seed and the try's number. What
does not end as docs/trust.md and docs/exit_codes.md say is printed, with its number, and `--only NUMBER` tries that one
again. At the end stands a table of what was tried and what failed; the exit code is 1 if anything did.

Needs Linux, and the packages of the tests: pip install '.[test]'.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np

from deepmuon_runtime import RefusedError
from studies.trust.campaigns import CAMPAIGNS
from studies.trust.tries import FaultError, Inputs, Random


@click.command()
@click.option("--hours", type=float, default=1.0, show_default=True, help="How long.")
@click.option("--seed", type=int, default=1, show_default=True, help="Of all random numbers.")
@click.option("--only", type=int, help="Only the try of this number.")
def main(hours: float, seed: int, only: int | None) -> None:
    """Try faults, damaged files and repetitions."""
    end = time.monotonic() + 3600 * hours
    tried: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as made:
        inputs = Inputs(Path(made))
        number = only or 0
        while time.monotonic() < end or number < len(CAMPAIGNS):
            name = list(CAMPAIGNS)[number % len(CAMPAIGNS)]
            tried[name] += 1
            fault = fault_of(CAMPAIGNS[name], inputs, np.random.default_rng([seed, number]))
            if fault:
                failed[name] += 1
                click.echo(f"{name}, seed {seed}, try {number}: {fault}")
            number += 1
            if only is not None:
                break
    click.echo(f"| campaign, seed {seed} | tried | failed |\n|---|--:|--:|")
    for name in CAMPAIGNS:
        click.echo(f"| {name} | {tried[name]} | {failed[name]} |")
    sys.exit(bool(failed))


def fault_of(campaign: Callable[[Inputs, Random, Path], None], inputs: Inputs, random: Random) -> str:
    """Return what went wrong in a try, or nothing."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            campaign(inputs, random, Path(folder))
        except (FaultError, RefusedError, subprocess.TimeoutExpired) as error:
            return f"{type(error).__name__}: {error}"
    return ""


if __name__ == "__main__":
    main()
