from __future__ import annotations

import sys

import click
import numpy as np
import pytest

from deepmuon_runtime import read_attributes, read_muons
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.check import check_file
from deepmuon_training.commands.train import train
from deepmuon_training.underground import depth_file, mulder_carrier

DEEP = "--flux measured --depth 1000 --seed 1"
COLUMNS = ("kinetic_energy", "u", "v", "w", "pdg_id")


@pytest.fixture
def source(tmp_path, monkeypatch, capsys):
    """Run the command: what it prints."""
    monkeypatch.chdir(tmp_path)

    def run(options: str) -> str:
        train.main(["source", *options.split()], prog_name="deepmuon-train", standalone_mode=False)
        return str(capsys.readouterr().out)

    return run


@pytest.fixture
def short_parts(monkeypatch):
    """Parts of a single chunk."""
    monkeypatch.setattr(depth_file, "CHUNKS_PER_PART", 1)


def same_muons(one, other) -> None:
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_muons_of_a_depth_say_what_they_are_and_are_the_same_for_any_number_of_processes(source, tmp_path):
    said = source(f"{DEEP} --medium rock -n 20_000 --processes 1 -o one.h5")
    assert "one.h5: 20,000 muons under 1000 m of standard_rock 2.65 g/cm3, rate 0.000448" in said
    assert "0.20% repeated, seed 1" in said
    assert check_file(tmp_path / "one.h5").defects == []
    known = read_attributes(tmp_path / "one.h5")
    assert known["depth_m"] == 1000
    assert known["medium"] == "standard_rock 2.65 g/cm3"
    assert known["flux"] == "measured"
    assert 0 < known["rate_uncertainty_hz_per_m2"] <= 1e-3 * known["rate_hz_per_m2"]
    assert "by mulder" in known["provenance"][0]
    assert [path.name for path in tmp_path.iterdir()] == ["one.h5"]

    assert source(f"{DEEP} --medium rock -n 20_000 --processes 2 -q -o two.h5") == ""
    same_muons(read_muons(tmp_path / "one.h5"), read_muons(tmp_path / "two.h5"))
    assert read_attributes(tmp_path / "two.h5")["rate_hz_per_m2"] == known["rate_hz_per_m2"]


def test_a_run_that_was_interrupted_goes_on_to_the_same_muons(source, tmp_path, short_parts, monkeypatch):
    source(f"{DEEP} -n 25_000 --processes 1 -q -o whole.h5")
    made = []

    def interrupted(path, sample):
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(path)
        depth_file_write(path, sample)

    depth_file_write = depth_file.write_sample
    with monkeypatch.context() as broken:
        broken.setattr(depth_file, "write_sample", interrupted)
        with pytest.raises((KeyboardInterrupt, click.Abort)):
            source(f"{DEEP} -n 25_000 --processes 1 -q -o broken.h5")
    assert not (tmp_path / "broken.h5").exists()
    before = [path.stat().st_mtime_ns for path in made]

    with pytest.raises(RefusedError, match=r"is of another run \(25000 muons carried back .*seed 1, 0.20% repeated\)"):
        source(f"{DEEP.replace('seed 1', 'seed 2')} -n 25_000 --processes 1 -q -o broken.h5")

    times = []
    with monkeypatch.context() as watched:
        remove = depth_file.MuonWriter.__exit__

        def look(writer, *exception):
            times.extend(path.stat().st_mtime_ns for path in made)
            return remove(writer, *exception)

        watched.setattr(depth_file.MuonWriter, "__exit__", look)
        source(f"{DEEP} -n 25_000 --processes 1 -q -o broken.h5")
    assert before == times[-2:]
    same_muons(read_muons(tmp_path / "whole.h5"), read_muons(tmp_path / "broken.h5"))
    assert not (tmp_path / "unfinished-broken.h5").exists()


def test_fewer_muons_of_a_seed_are_the_first_of_more(source, tmp_path, short_parts):
    source(f"{DEEP} -n 25_000 --processes 1 -q -o more.h5")
    source(f"{DEEP} -n 14_000 --processes 1 -q -o fewer.h5")
    same_muons(read_muons(tmp_path / "fewer.h5"), read_muons(tmp_path / "more.h5", 0, 14_000))


def test_a_depth_of_0_is_the_flux_itself(source, tmp_path):
    source("--flux measured --depth 0 -n 100 --seed 1 -o zero.h5")
    source("--flux measured -n 100 --seed 1 -o sea_level.h5")
    same_muons(read_muons(tmp_path / "zero.h5"), read_muons(tmp_path / "sea_level.h5"))


TABLE = "".join(
    f"{energy},{cosine},{energy**-2.7},{energy**-2.7}\n" for cosine in (0.1, 1.0) for energy in (1, 10, 100)
)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ("--flux measured --depth -3", "a depth of -3 m: it should be a positive number of metres"),
        ("--flux measured --depth nan", "a depth of nan m"),
        ("--flux measured --depth 10 --medium ice", "the medium 'ice' is unknown here: expected was water or rock"),
        ("--flux measured --depth 10 --density 0", "0 is not a finite number above 0"),
        ("--flux measured --depth 10 --density 99", "a density of 99 g/cm3: it should be"),
        ("--flux measured --medium rock", "the depth is 0: give --depth as well"),
        ("--flux mine.csv --depth 400", "the flux mine.csv ends at 100 GeV, and 400 m of water take"),
        ("--flux mine.csv --depth 300", "come from its upper half"),
        ("--flux hole.csv --depth 10", "every cos zenith needs the energies of the first"),
        ("--flux negative.csv --depth 10", "has a negative flux"),
    ],
)
def test_what_can_not_be_carried_is_refused_in_a_line(source, tmp_path, options, reason):
    (tmp_path / "mine.csv").write_text(TABLE)
    (tmp_path / "hole.csv").write_text("\n".join(TABLE.splitlines()[:-2]))
    (tmp_path / "negative.csv").write_text(TABLE.replace(",1,1\n", ",-1,1\n").replace(",1.0,1", ",1.0,-1", 1))
    before = sorted(tmp_path.iterdir())
    with pytest.raises((click.UsageError, RefusedError)) as refusal:
        source(f"{options} -n 10 --seed 1 --processes 1 -o muons.h5")
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert sorted(tmp_path.iterdir()) == before


def test_where_mulder_is_not_installed_its_installation_is_told(source, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mulder", None)
    mulder_carrier._fluxmeter.cache_clear()
    mulder_carrier.ranges.cache_clear()
    with pytest.raises(RefusedError, match=r"mulder is needed: pip install 'deepmuon-training\[mulder\]'"):
        source(f"{DEEP} -n 10 -o muons.h5")
    assert not list(tmp_path.iterdir())
