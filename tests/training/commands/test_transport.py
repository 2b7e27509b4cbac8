from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from support.worked_example import run_example

from deepmuon_runtime import Generator, read_attributes, read_muons, write_muons
from deepmuon_runtime.muon_file.check import check_file
from deepmuon_training.commands.train import main
from deepmuon_training.sample import read_sample
from deepmuon_training.transport import slab as transport_module
from deepmuon_training.transport.slab import transport

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-train"


@pytest.fixture
def carry(tmp_path, monkeypatch, capsys):
    """Run the command in this process, in a folder with 2,000 muons of sea level: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    Generator.open(0).write("sea_level.h5", 2000, 1)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["/bin/deepmuon-train", "transport", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, *capsys.readouterr()

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture
def no_geant4(monkeypatch):
    """Fail if any muon is carried."""

    def started(*_):
        raise AssertionError("Geant4 was started")

    monkeypatch.setattr(transport_module, "run_geant4", started)


def test_the_example_prints_what_its_help_says(tmp_path):
    # Another type of CPU may round otherwise, and then other muons stop: numbers may differ by 4 %.
    shown, printed = run_example(tmp_path, "deepmuon-train transport")
    number = re.compile(r"\d[\d,.]*")
    assert number.sub("#", " ".join(printed.split())) == number.sub("#", " ".join(shown.split()))
    for one, other in zip(number.findall(printed), number.findall(shown), strict=True):
        assert float(one.replace(",", "")) == pytest.approx(float(other.replace(",", "")), rel=0.04)


def test_the_survivors_are_those_of_the_library_and_their_number_is_told(carry):
    code, out, err = carry("sea_level.h5", "--thickness", 10, "--seed", 3, "-o", "below.h5")
    assert (code, err) == (0, "")
    expected = transport(read_sample("sea_level.h5"), 10.0, seed=3, progress=False)
    found = read_sample("below.h5")
    for name in expected.sample.muons.columns:
        assert np.array_equal(getattr(found.muons, name), getattr(expected.sample.muons, name))
    assert found.rate == expected.sample.rate
    assert found.provenance == expected.sample.provenance
    first, *fates = out.splitlines()
    assert re.fullmatch(
        rf"below\.h5: {len(found):,} of 2,000 muons \(\d\d\.\d\d%, \d\d\.\d\d% to \d\d\.\d\d%\) "
        rf"under 10 m of G4_WATER, {found.rate:.4g} per m2 and s, seed 3",
        first,
    )
    assert len(found) + sum(int(line.split()[0].replace(",", "")) for line in fates) == 2000


def test_a_box_of_rock_loses_muons_by_its_sides(carry):
    options = ("--thickness", 2, "--box", 4, 3, "--material", "standard_rock", "--density", 2.5, "--seed", 1)
    code, out, _ = carry("sea_level.h5", *options, "-o", "below.h5")
    assert code == 0
    lost = int(re.search(r"(\d+) left by the sides", out).group(1))
    survivors = read_attributes("below.h5")
    assert 200 < lost < 2000 - survivors["count"]
    assert survivors["medium"] == "standard_rock 2.5 g/cm3"
    assert "4 m x 3 m wide" in survivors["provenance"][-1]


@pytest.mark.usefixtures("carry")
def test_where_no_muon_survives_the_limit_is_told_and_nothing_is_written():
    write_muons("slow.h5", read_muons("sea_level.h5", 0, 100), {"depth_m": 0.0, "medium": "G4_WATER"})
    words = [COMMAND, "transport", "slow.h5", "--thickness", "4000", "-o", "below.h5"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        "deepmuon-train: none of 100 muons survived 4000 m of G4_WATER (at 68 % confidence it is below 0.018 of them): "
        "carry more, or take a thinner slab\n"
    )
    assert not os.path.exists("below.h5")


def test_where_all_survive_the_interval_has_a_width_and_the_file_is_sound(carry):
    write_muons("fast.h5", read_sample("sea_level.h5").muons[:100], {**read_sample("sea_level.h5").attributes})
    code, out, _ = carry("fast.h5", "--thickness", 1e-6, "--seed", 1, "-o", "below.h5")
    assert code == 0
    assert out.startswith("below.h5: 100 of 100 muons (100.00%, 98.18% to 100.00%) under 1e-06 m of G4_WATER, ")
    assert check_file("below.h5").defects == []
    assert read_attributes("below.h5")["rate_uncertainty_hz_per_m2"] > 0.9 * 0.0091 * read_sample("below.h5").rate


def test_quiet_says_nothing(carry):
    assert carry("sea_level.h5", "--thickness", 1, "-q", "-o", "below.h5") == (0, "", "")


@pytest.mark.usefixtures("no_geant4")
@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--material", "G4_CHEESE"], "no material G4_CHEESE"),
        (["--material", "standard_rock", "--density", 99], "density of 99"),
        (["--box", 60, 0], "not a finite number above 0"),
        (["--thickness", "-1"], "not a finite number above 0"),
        (["--seed", -1], "-1 is not from 0"),
        (["--processes", 0], "processes"),
        (["-o", "sea_level.h5"], "sea_level.h5 is read here, and would be replaced"),
        (["-o", "sea_level.h5", "--overwrite"], "sea_level.h5 is read here, and would be replaced"),
        (["-o", "link.h5", "--overwrite"], "link.h5 is read here, and would be replaced"),
        (["-o", "other.h5"], "exists already"),
        (["-o", "no_folder/below.h5"], "no folder"),
        (
            ["-o", "below.csv"],
            "below.csv would be HDF5 under a name of text: write below.h5, and then",
        ),
        (["-o", "-"], "- is no name of a muon file"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_starts(carry, options, complaint):
    os.symlink("sea_level.h5", "link.h5")
    Path("other.h5").write_text("precious")
    before = sorted(os.listdir())
    code, out, err = carry("sea_level.h5", "--thickness", 10, "-o", "below.h5", *options)
    assert (code, out) == (2, "")
    assert complaint in err
    assert err.count("\n") == 1
    assert sorted(os.listdir()) == before
    assert len(read_muons("sea_level.h5")) == 2000


@pytest.mark.usefixtures("no_geant4")
@pytest.mark.parametrize(
    ("name", "value"), [("kinetic_energy", math.nan), ("kinetic_energy", -1.0), ("w", 0.9), ("w", math.nan)]
)
def test_a_muon_that_cannot_be_carried_is_refused_by_its_row(carry, name, value):
    muons = read_muons("sea_level.h5")
    getattr(muons, name)[7] = value
    write_muons("bad.h5", muons, {"depth_m": 0.0, "medium": "G4_WATER"})
    code, _, err = carry("bad.h5", "--thickness", 10, "-o", "below.h5")
    assert code == 2
    assert "muon 7 has" in err
    assert not os.path.exists("below.h5")


@pytest.mark.usefixtures("no_geant4")
@pytest.mark.parametrize("content", [b"", b"no HDF5", None])
def test_a_file_that_holds_no_muons_is_refused(carry, content):
    if content is not None:
        with open("other.h5", "wb") as file:
            file.write(content)
    code, _, err = carry("other.h5", "--thickness", 10, "-o", "below.h5")
    assert code == 2
    assert "other.h5" in err
