"""Faults of a run, for real: afterwards there is no output, or a complete and good one."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sysconfig
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from support.commands import wait_for_answers
from support.thorough import TIMES
from support.tiny_models import RARELY_BAD, tiny_model

from deepmuon_runtime import check_file, read_attributes

pytestmark = pytest.mark.campaign

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-gen"
LONGEST = 600  # s, on any machine
STRIKES = 10 * TIMES  # of each signal
MANY = 20_000_000  # muons that take a while


def start(model: Path, folder: Path, *arguments: str, n: int = 1_000_000, **options: object) -> subprocess.Popen[str]:
    """Start a run that writes muons.h5 in a folder."""
    words = [COMMAND, "--model", model, "-n", str(n), "-o", "muons.h5", *arguments]
    return subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **options)


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for the end of a run: exit code, stderr."""
    _, err = process.communicate(timeout=LONGEST)
    return process.returncode, err


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + LONGEST
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def partial_files(folder: Path) -> list[Path]:
    return list(folder.glob("muons.h5.*.deepmuon-partial"))


def stopped_while_writing(model: Path, folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start a long run and halt it when a part of its muons is written."""
    process = start(model, folder, *arguments, n=MANY)
    wait_until(lambda: any(path.stat().st_size > 1_000_000 for path in partial_files(folder)))
    process.send_signal(signal.SIGSTOP)
    return process


def go_on(process: subprocess.Popen[str]) -> tuple[int, str]:
    process.send_signal(signal.SIGCONT)
    return ended(process)


def struck_at_random_moments(model: Path, folder: Path, number: signal.Signals) -> Iterator[subprocess.Popen[str]]:
    """Yield runs that got a signal at a moment between their beginning and what was the end of an undisturbed one."""
    began = time.monotonic()
    assert ended(start(model, folder)) == (0, "")
    duration = time.monotonic() - began
    (folder / "muons.h5").unlink()
    for delay in np.random.default_rng(number).uniform(0, duration, STRIKES):
        process = start(model, folder)
        if number != signal.SIGKILL:
            wait_for_answers(process)
        time.sleep(delay)
        process.send_signal(number)
        yield process


def assert_named_by_the_next_run(left: Path, model: Path) -> None:
    """Run again where a killed run left a temporary file, and remove that and the output."""
    code, err = ended(start(model, left.parent, n=10))
    assert code == 0
    assert err.startswith("deepmuon-gen: warning: ")
    assert left.name in err
    assert err.count("\n") == 1
    left.unlink()
    (left.parent / "muons.h5").unlink()


def fill_up(folder: Path) -> None:
    """Take all the room that a file system has."""
    with (folder / "filler").open("wb", buffering=0) as filler:
        while filler.write(bytes(1 << 20)):
            pass


@pytest.fixture(scope="module")
def tiny_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("model") / "tiny.onnx"
    path.write_bytes(tiny_model())
    return path


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP], ids=["SIGTERM", "Ctrl-C", "SIGHUP"])
def test_a_run_that_is_stopped_at_a_random_moment_leaves_nothing_or_all(tmp_path, tiny_file, number):
    """10 moments of each, and one in the middle of the writing."""
    output = tmp_path / "muons.h5"
    for process in struck_at_random_moments(tiny_file, tmp_path, number):
        code, err = ended(process)
        assert partial_files(tmp_path) == []
        if code == 128 + number:
            assert err == f"deepmuon-gen: stopped by {number.name}\n"
        else:
            assert code == 0  # all was done
            assert output.exists()
        if output.exists():
            assert check_file(output).defects == []
            output.unlink()
    process = stopped_while_writing(tiny_file, tmp_path)
    process.send_signal(number)
    assert go_on(process) == (128 + number, f"deepmuon-gen: stopped by {number.name}\n")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_is_killed_at_a_random_moment_leaves_nothing_or_all_under_the_name(tmp_path, tiny_file):
    """10 moments, and one in the middle of the writing; and the next run says what it found."""
    output = tmp_path / "muons.h5"
    for process in struck_at_random_moments(tiny_file, tmp_path, signal.SIGKILL):
        ended(process)
        if output.exists():
            assert check_file(output).defects == []
            output.unlink()
        for path in partial_files(tmp_path):
            assert_named_by_the_next_run(path, tiny_file)
    process = stopped_while_writing(tiny_file, tmp_path)
    process.kill()
    ended(process)
    assert not output.exists()
    (left,) = partial_files(tmp_path)
    assert_named_by_the_next_run(left, tiny_file)


@pytest.fixture
def small_disk(tmp_path, request) -> Iterator[Path]:
    """A file system of its own, of 350 MB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size=350m{request.param}", "tmpfs", folder], capture_output=True, text=True
    )
    if mounted.returncode:
        pytest.skip(f"only root may mount a file system: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", folder], check=True)


@pytest.mark.parametrize("small_disk", [""], indirect=True)
def test_a_disk_that_fills_up_ends_the_run_and_leaves_nothing(small_disk, tiny_file):
    process = stopped_while_writing(tiny_file, small_disk)
    with pytest.raises(OSError, match="No space left"):
        fill_up(small_disk)
    code, err = go_on(process)
    assert code == 1
    assert err == f"deepmuon-gen: {small_disk.resolve()}/muons.h5 was not written: No space left on device\n"
    assert [path.name for path in small_disk.iterdir()] == ["filler"]


def test_a_limit_of_the_files_size_ends_the_run_and_leaves_nothing(tmp_path, tiny_file):
    limit = 1_000_000, 1_000_000
    process = start(tiny_file, tmp_path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit))
    assert ended(process) == (1, f"deepmuon-gen: {tmp_path.resolve()}/muons.h5 was not written: File too large\n")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_vanishes_ends_the_run(tmp_path, tiny_file):
    folder = tmp_path / "folder"
    folder.mkdir()
    process = stopped_while_writing(tiny_file, folder)
    shutil.rmtree(folder)
    code, err = go_on(process)
    assert code == 1
    assert err.startswith(f"deepmuon-gen: {folder.resolve()}/muons.h5 was not written: ")
    assert not folder.exists()


@pytest.mark.parametrize("small_disk", [",ro"], indirect=True)
def test_a_read_only_file_system_is_refused(small_disk, tiny_file):
    code, err = ended(start(tiny_file, small_disk))
    assert (code, "is not writable" in err) == (2, True)


@pytest.mark.parametrize("folder", ["/proc", "/sys"])
def test_a_folder_that_takes_no_files_is_refused(folder, tiny_file):
    code, err = ended(start(tiny_file, Path(folder)))
    assert (code, err.count("\n")) == (2, 1)
    assert partial_files(Path(folder)) == []


def test_of_two_runs_the_one_that_comes_second_is_told(tmp_path, tiny_file):
    slow = stopped_while_writing(tiny_file, tmp_path, "--seed", "1")
    assert ended(start(tiny_file, tmp_path, "--seed", "2")) == (0, "")
    code, err = go_on(slow)
    assert code == 1
    assert err.endswith("muons.h5 was written by another process meanwhile: kept as it is\n")
    assert read_attributes(tmp_path / "muons.h5")["seed"] == 2
    assert check_file(tmp_path / "muons.h5").defects == []
    assert partial_files(tmp_path) == []


def test_of_runs_at_the_same_time_one_wins(tmp_path, tiny_file):
    """5 races of 3."""
    for _ in range(5 * TIMES):
        processes = [start(tiny_file, tmp_path, "--seed", str(seed)) for seed in range(3)]
        codes = [ended(process)[0] for process in processes]
        winner = codes.index(0)
        assert set(codes[:winner] + codes[winner + 1 :]) <= {1, 2}
        assert read_attributes(tmp_path / "muons.h5")["seed"] == winner
        assert check_file(tmp_path / "muons.h5").defects == []
        assert partial_files(tmp_path) == []
        (tmp_path / "muons.h5").unlink()


@pytest.mark.parametrize("name", ["mcpl", "mcpl.gz", "root", "csv", "csv.gz"])
def test_in_every_format_a_run_that_is_ended_while_it_writes_leaves_nothing_under_the_name(tmp_path, tiny_file, name):
    output = f"muons.{name}"
    for number, code in ((signal.SIGTERM, 128 + signal.SIGTERM), (signal.SIGKILL, -signal.SIGKILL)):
        words = [COMMAND, "--model", tiny_file, "-n", str(MANY), "-q", "-o", output]
        process = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
        wait_until(lambda: any(path.stat().st_size > 1_000_000 for path in tmp_path.glob(f"{output}.*")))
        process.send_signal(number)
        assert ended(process)[0] == code
        left = [path.name for path in tmp_path.iterdir()]
        assert output not in left
        assert left == [] or number == signal.SIGKILL


def test_a_model_that_gives_a_bad_muon_ends_the_run_with_its_number_and_leaves_nothing(tmp_path):
    (tmp_path / "bad.onnx").write_bytes(tiny_model(edits=RARELY_BAD))
    (tmp_path / "here").mkdir()
    code, err = ended(start(tmp_path / "bad.onnx", tmp_path / "here", "--seed", "1"))
    assert code == 1
    assert "bad muon: number " in err
    assert os.listdir(tmp_path / "here") == []
