from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from deepmuon_runtime import Generator
from studies.benchmark import by_hand, job

REPOSITORY = Path(__file__).parents[3]
START = {"python": sys.executable, "deepmuon-gen": f"{sys.executable} -m deepmuon_cli.gen"}

DRIVER = """#!/bin/sh
# Stands for a driver of another generator: COUNT SEED OUT
head -c $((20 * $1)) /dev/zero > "$3"
"""


@pytest.fixture
def driver(tmp_path: Path) -> Path:
    path = tmp_path / "driver"
    path.write_text(DRIVER)
    path.chmod(0o755)
    return path


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "studies.benchmark.rates", *arguments]
    return subprocess.run(command, capture_output=True, text=True, env=environment, cwd=REPOSITORY)


def test_all_contestants_run_and_are_in_the_table_and_beside_it(driver: Path, tmp_path: Path):
    output, old = tmp_path / "benchmark", tmp_path / "old"
    (old / "bin").mkdir(parents=True)
    for name in ("deepmuon-gen", "python"):  # this release stands for that one
        (old / "bin" / name).write_text(
            f'#!/bin/sh\nPYTHONPATH="{os.environ.get("PYTHONPATH", "")}" exec {START[name]} "$@"\n'
        )
        (old / "bin" / name).chmod(0o755)
    done = run("-n", "1000", "--repetitions", "1", "--cry", driver, "--linear", "--old", old, "--output", output)
    assert done.returncode == 0, done.stderr
    assert output.with_suffix(".md").read_text().startswith(done.stdout.removesuffix("\n"))
    report = json.loads(output.with_suffix(".json").read_text())
    rows = {row["name"]: row for row in report["rows"]}
    assert {"deepmuon-gen", "library, no file", "CRY", "limit: writing alone"} < set(rows)
    assert {"deepmuon-gen --box 4 4 3", "deepmuon-gen --energy-min 1"} < set(rows)
    assert "EcoMug" not in rows
    assert (rows["CRY"]["muons"], rows["CRY"]["bytes_per_muon"]) == (40, 20)
    assert {"sample() to memory", "0.1.0", "sample() to memory, 0.1.0"} < set(rows)
    for name, row in rows.items():
        assert f"| {name} |" in done.stdout
        assert len(row["processor_seconds"]) == 1
        assert row["processor_seconds"][0] > 0 or name == "CRY"
        assert row["muons_per_second"] * row["seconds"][0] == pytest.approx(row["muons"])
        assert row["peak_memory"] > 1e6
    assert [(line["kind"], line["muons"]) for line in report["linear"]] == [
        (kind, muons) for kind in ("to a file", "discarded") for muons in (10, 100, 1000, 10_000)
    ]


def test_a_program_that_fails_ends_the_benchmark_and_is_named(driver: Path):
    driver.write_text("#!/bin/sh\nexit 7\n")
    done = run("-n", "1000", "--cry", driver)
    assert done.returncode == 1
    assert done.stderr.startswith(f"this failed: {driver} 1 ")


def test_a_sampler_by_hand_makes_as_many_muons_as_are_reported():
    made = []

    def sampler(random: np.random.Generator, n: int) -> list[np.ndarray]:
        made.append([len(column) for column in by_hand.inverse_cdf(random, n)])
        assert [len(column) for column in by_hand.accept_reject(random, n)] == made[-1]
        return []

    job.by(sampler)(by_hand.PIECE + 100, 1, "-")
    assert made == [[by_hand.PIECE] * 5, [100] * 5]


def test_the_job_that_writes_makes_no_muons_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    Generator.open(0).write(tmp_path / "made.h5", 1000, seed=1)
    monkeypatch.setattr(job, "Generator", None)
    job.write(str(tmp_path / "made.h5"), 2500, 1, str(tmp_path / "out"))
    with h5py.File(tmp_path / "made.h5") as made, h5py.File(tmp_path / "out") as out:
        for name in out:
            column = made["muons"][name][:]
            assert np.array_equal(out[name][:], np.concatenate([column, column, column[:500]]))


def test_both_samplers_by_hand_sample_the_same_flux():
    """Kolmogorov-Smirnov at 1e-6 false alarms each: 2.7 sqrt(2 / n)."""
    random = np.random.default_rng(1)
    n = by_hand.PIECE
    for a, b in zip(by_hand.accept_reject(random, n), by_hand.inverse_cdf(random, n), strict=True):
        both = np.concatenate([a, b])
        distance = np.abs(np.searchsorted(np.sort(a), both) - np.searchsorted(np.sort(b), both)).max() / n
        assert distance < 2.7 * np.sqrt(2 / n)


def test_the_samplers_by_hand_sample_the_flux_that_is_published():
    """Means of log E and cos zenith against EcoMug's formula as deepmuon_training has it, at 5 standard deviations."""
    flux = pytest.importorskip("deepmuon_training.fluxes.ecomug")
    muons = flux.sea_level_muons(by_hand.PIECE, seed=1, minimum=5e-4, maximum=1e3)
    energy, _, _, w, _ = by_hand.inverse_cdf(np.random.default_rng(1), by_hand.PIECE)
    for a, b in ((np.log(energy), np.log(muons.kinetic_energy)), (w, muons.w)):
        assert abs(a.mean() - b.mean()) < 5 * np.sqrt((a.var() + b.var()) / len(a))
