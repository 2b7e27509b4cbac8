"""`deepmuon-gen` with cuts, targets and times."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from support.analytic_family import analytic_family

from deepmuon_cli.gen import main
from deepmuon_cli.process.signals import SIGNALS
from deepmuon_runtime import Box, Cuts, Generator, check_file, read_attributes, read_muons


@pytest.fixture
def gen(tmp_path, monkeypatch, capsys):
    """Run the command in this process, in a folder of its own with a family: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    Path("family.onnx").write_bytes(analytic_family())
    handlers = {number: signal.getsignal(number) for number in SIGNALS}

    def run(*arguments: object) -> tuple[int, str, str]:
        words = ["/bin/deepmuon-gen", "--model", "family.onnx", "-o", "muons.h5", *map(str, arguments)]
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, *capsys.readouterr()

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


def test_the_muons_of_a_box_in_a_live_time_are_written_and_recorded(gen):
    code, out, err = gen("--box", 4, 4, 0.5, "--live-time", 10, "--energy-min", 2, "--seed", 1)
    assert (code, err) == (0, "")
    found = read_muons("muons.h5")
    expected = Generator.open(file="family.onnx").sample(
        seed=1, live_time=10.0, target=Box(4, 4, 0.5), cuts=Cuts(energy_min=2)
    )
    for name, column in expected.columns.items():
        assert np.array_equal(column, found.columns[name])
    said = read_attributes("muons.h5")
    assert said["command_line"] == ("deepmuon-gen --live-time 10.0 --energy-min 2.0 --box 4.0 4.0 0.5 --seed 1")
    assert (said["target"], said["target_size_m"], said["surface"]) == ("box", [4, 4, 0.5], 1)
    assert (said["live_time_s"], said["energy_min_gev"]) == (10, 2)
    assert said["fraction_kept"] == pytest.approx(0.2, rel=1e-3)
    assert f"live time 10 s on the box at {said['target_rate_hz']:.5g} a second" in out
    assert check_file("muons.h5").defects == []


@pytest.mark.parametrize(
    "arguments",
    [("--plane", 1, 2), ("--sphere", 0.2), ("--cylinder", 1, 0.5), ("--zenith-min", 30, "--zenith-max", 60)],
)
def test_each_choice_gives_a_good_file_of_the_wanted_number(gen, arguments):
    code, _, err = gen(*arguments, "-n", 1000)
    assert (code, err) == (0, "")
    report = check_file("muons.h5")
    assert (report.defects, report.examined) == ([], 1000)


@pytest.mark.filterwarnings("always")
def test_a_narrow_cut_and_a_tall_body_are_told_of_before_it_starts(gen):
    code, _, err = gen("--energy-min", 2000, "-n", 10)
    assert code == 0
    assert err == "deepmuon-gen: warning: the cuts keep 1 muon in 4e+06\n"
    code, _, err = gen("--box", 1, 1, 3, "-n", 10, "--overwrite")
    assert code == 0
    assert err.startswith("deepmuon-gen: warning: the box gets the muons of its centre, at 10 m, all over: 87.169 ")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("--box", 4, 4, 0), "0 is not a finite number above 0"),
        (("--box", 4, -4, 1), "-4 is not a finite number above 0"),
        (("--sphere", "nan"), "nan is not a finite number above 0"),
        (("--sphere", "wide"), "wide is no number of metres"),
        (("--sphere", "1e9"), "the radius of a sphere is 1e+09 m, and should be from 1e-6 to 1e6 m"),
        (("--box", 4, 4), "requires 3 arguments"),
        (("--box", 4, 4, 1, "--plane", 1, 1), "there is one target: --plane and --box don't go together"),
        (("--sphere", 1, "--area", 1), "a target has its own area: leave out --area"),
        (("--energy-min", 5, "--energy-max", 2), "no muon is left: the energy min, 5 GeV, is not below"),
        (("--energy-min", "5 TeV"), "5 TeV is no number of GeV: write 5000"),
        (("--energy-min", 1e9), "no muon is left: those of"),
        (("--zenith-max", 100), "the zenith max is 100 degrees, and should be from 0 to 90"),
        (("--zenith-min", 90), "no muon is left"),
        (("--emin", 1), "write --energy-min GEV"),
    ],
)
def test_a_choice_that_can_not_be_is_refused_in_one_line_and_leaves_nothing(gen, arguments, reason):
    code, out, err = gen("-n", 10, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert reason in err
    assert os.listdir() == ["family.onnx"]
