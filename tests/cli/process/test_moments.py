"""Signals at the very beginning and the very end of a command, and a second one: the documented codes, no traceback."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.commands import wait_for_answers
from support.thorough import TIMES

SCRIPTS = dict(
    re.findall(
        r'^(deepmuon-\w+) = "(deepmuon_cli\S+)"$',
        (Path(__file__).parents[3] / "pyproject.toml").read_text("utf-8"),
        re.MULTILINE,
    )
)
"""The installed commands, and where pip's scripts begin."""

SCRIPT = "import sys; from {0} import {1}; sys.exit({1}())"  # pip's


def start(name: str, *words: str) -> subprocess.Popen[str]:
    """Start a command, and wait until it, and no longer Python, answers signals."""
    module, function = SCRIPTS[name].split(":")
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT.format(module, function), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for_answers(process)
    return process


def until_it_ends(name: str) -> float:
    """Return how long `--version` takes, in s."""
    began = time.monotonic()
    process = start(name, "--version")
    process.communicate(timeout=600)
    assert process.returncode == 0
    return time.monotonic() - began


@pytest.mark.parametrize("name", ["deepmuon-gen", "deepmuon-check"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_a_signal_at_any_moment_from_the_beginning_to_the_end_has_its_code_and_no_traceback(name, number):
    """10 moments of each, but those in which Python itself begins."""
    for moment in np.random.default_rng(number).uniform(0, 1.2 * until_it_ends(name), 10 * TIMES):
        process = start(name, "--version")
        time.sleep(moment)
        process.send_signal(number)
        _, err = process.communicate(timeout=600)
        expected = {0: "", 128 + number: f"{name}: stopped by {number.name}\n"}
        assert process.returncode in expected, err
        assert err == expected[process.returncode]


def test_of_two_signals_one_gives_the_code():
    """20 pairs, some milliseconds apart."""
    for moment, pause in np.random.default_rng(1).uniform(0, (0.3, 0.02), (20 * TIMES, 2)):
        process = start("deepmuon-check", "--version")
        time.sleep(moment)
        process.send_signal(signal.SIGTERM)
        time.sleep(pause)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=600)
        assert process.returncode in (0, 143, 130), err
        assert err in ("", "deepmuon-check: stopped by SIGTERM\n", "deepmuon-check: stopped by SIGINT\n")
