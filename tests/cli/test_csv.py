from __future__ import annotations

import json
import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from support.worked_example import run_example

from deepmuon_runtime import Generator, Muons, read_attributes, read_muons, write_muons

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-csv"
MUONS = 70_001


@pytest.fixture
def csv(tmp_path, model_file):
    """Run the installed command in a folder with a muon file: exit code, stdout, stderr."""
    Generator.open(file=model_file).write(tmp_path / "muons.h5", MUONS, seed=1)

    def run(*arguments: str) -> tuple[int, str, str]:
        done = subprocess.run([COMMAND, *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=120)
        return done.returncode, done.stdout, done.stderr

    return run


def columns(text: str) -> np.ndarray:
    lines = [line for line in text.splitlines() if line[0] not in "#k"]
    return np.array([line.split(",") for line in lines], dtype=np.float32).T


def test_the_example_prints_what_its_help_says(tmp_path):
    shown, printed = run_example(tmp_path, "deepmuon-csv")
    assert printed == shown
    assert shown.count("$ ") == 5


def test_every_muon_is_there_to_the_last_bit(csv, tmp_path):
    assert csv("muons.h5", "-o", "muons.csv") == (0, "", "")
    text = (tmp_path / "muons.csv").read_text(encoding="ascii")
    assert "\nkinetic_energy_GeV,u,v,w,pdg_id\n" in text
    muons = read_muons(tmp_path / "muons.h5")
    for name, found in zip(("kinetic_energy", "u", "v", "w", "pdg_id"), columns(text), strict=True):
        np.testing.assert_array_equal(found, getattr(muons, name))


def test_comments_say_what_the_file_says(csv, tmp_path):
    comments = [line for line in csv("muons.h5", "-o", "-")[1].splitlines() if line.startswith("#")]
    said = dict(line.removeprefix("# ").split(" = ", 1) for line in comments)
    expected = {"format": "deepmuon-muons", **read_attributes(tmp_path / "muons.h5")}
    assert {name: json.loads(value) for name, value in said.items()} == expected


def test_units_and_header_are_as_asked_for(csv):
    gev, mev = (csv("muons.h5", "-o", "-", "--no-header", "--units", unit)[1] for unit in ("GeV", "MeV"))
    assert gev[0].isdigit()
    np.testing.assert_allclose(columns(mev)[0], 1000 * columns(gev)[0], rtol=1e-6)
    np.testing.assert_array_equal(columns(mev)[1:], columns(gev)[1:])


def phits(text: str) -> np.ndarray:
    return np.array([line.split(" ") for line in text.splitlines()], dtype=float).T


def test_a_list_for_phits_has_its_ten_columns(csv, tmp_path):
    code, text, err = csv("muons.h5", "--phits", "4", "--seed", "7", "-o", "-")
    assert (code, err) == (0, "")
    code, x, y, z, u, v, w, energy, weight, time = phits(text)
    muons = read_muons(tmp_path / "muons.h5")
    np.testing.assert_array_equal(code, muons.pdg_id)
    np.testing.assert_allclose(energy, 1e3 * muons.kinetic_energy.astype(float), rtol=1e-8)
    np.testing.assert_allclose([u, v, w], [muons.u, muons.v, muons.w], atol=2e-7)
    np.testing.assert_allclose(u**2 + v**2 + w**2, 1, rtol=0, atol=1e-15)
    assert (np.abs([x, y]) < 200).all()
    # Means, and the correlation of x and y, within 5 standard deviations: 2e-6 false alarms.
    assert np.abs(np.mean([x, y], axis=1)).max() < 5 * 400 / np.sqrt(12 * MUONS)
    assert abs(np.corrcoef(x, y)[0, 1]) < 5 / np.sqrt(MUONS)
    assert len(np.unique(x)) > 0.99 * MUONS
    assert {*z, *time} == {0.0}
    assert {*weight} == {1.0}


def test_the_places_for_phits_are_those_of_the_seed(csv):
    asked = ("muons.h5", "--phits", "4", "-o", "-")
    one, again, other = (csv(*asked, "--seed", seed)[1] for seed in ("1", "1", "2"))
    assert one == again
    assert not np.any(phits(one)[1] == phits(other)[1])
    assert csv(*asked)[1] != csv(*asked)[1]


def test_a_list_for_phits_is_the_same_in_any_language(csv, tmp_path, monkeypatch):
    monkeypatch.setenv("LC_ALL", "de_DE.UTF-8")
    monkeypatch.setenv("LC_NUMERIC", "de_DE.UTF-8")
    assert "," not in csv("muons.h5", "--phits", "1.5", "-o", "-")[1]


def test_stdout_gets_what_a_file_gets(csv, tmp_path):
    csv("muons.h5", "-o", "muons.csv")
    assert csv("muons.h5", "-o", "-") == (0, (tmp_path / "muons.csv").read_text(encoding="ascii"), "")


def test_a_reader_that_goes_ends_the_command_silently(csv, tmp_path):
    done = subprocess.run(
        f"'{COMMAND}' muons.h5 -o - | grep -m 1 kinetic; exit ${{PIPESTATUS[0]}}",
        shell=True,
        executable="/bin/bash",
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stdout, done.stderr) == (141, "kinetic_energy_GeV,u,v,w,pdg_id\n", "")


def test_a_file_of_no_muon_is_a_header(csv, tmp_path):
    write_muons(tmp_path / "none.h5", Muons.empty(0), {"depth_m": 0.0, "medium": "G4_WATER"})
    code, out, err = csv("none.h5", "-o", "-")
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == '# format = "deepmuon-muons"'
    assert out.splitlines()[-1] == "kinetic_energy_GeV,u,v,w,pdg_id"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["missing.h5", "-o", "muons.csv"], "missing.h5 can't be read"),
        (["text.h5", "-o", "muons.csv"], "text.h5 can't be read"),
        (["muons.h5"], "Missing option '-o'"),
        (["muons.h5", "-o", "no/muons.csv"], "there is no folder"),
        (["muons.h5", "-o", "."], "is a folder"),
        (["muons.h5", "-o", "a" * 300], "can't be written: File name too long"),
        (["a" * 300, "-o", "muons.csv"], "can't be read as a muon file: File name too long"),
        (["muons.h5", "-o", "muons.csv", "--units", "keV"], "'keV' is not one of"),
        (["muons.h5", "-o", "muons.phits", "--phits", "0"], "--phits takes a finite length above 0"),
        (["muons.h5", "-o", "muons.phits", "--phits", "inf"], "--phits takes a finite length above 0"),
        (["muons.h5", "-o", "muons.phits", "--phits", "10m"], "10m is no number of metres: write 10"),
    ],
)
def test_what_can_t_be_done_is_refused_and_leaves_nothing(csv, tmp_path, arguments, reason):
    (tmp_path / "text.h5").write_text("no HDF5")
    before = sorted(tmp_path.iterdir())
    code, out, err = csv(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("deepmuon-csv: ")
    assert err.count("\n") == 1
    assert reason in err
    assert sorted(tmp_path.iterdir()) == before


def test_an_existing_output_is_replaced_only_where_asked(csv, tmp_path):
    (tmp_path / "muons.csv").write_text("precious")
    assert csv("muons.h5", "-o", "muons.csv")[0] == 2
    assert (tmp_path / "muons.csv").read_text() == "precious"
    assert csv("muons.h5", "-o", "muons.csv", "--overwrite") == (0, "", "")
    assert columns((tmp_path / "muons.csv").read_text()).shape == (5, MUONS)


def test_the_muon_file_itself_is_never_replaced(csv, tmp_path):
    before = (tmp_path / "muons.h5").read_bytes()
    (tmp_path / "link.h5").symlink_to("muons.h5")
    for output in ("muons.h5", "link.h5"):
        code, out, err = csv("muons.h5", "-o", output, "--overwrite")
        assert (code, out) == (2, "")
        assert f"{output} is read here, and would be replaced" in err
    assert (tmp_path / "muons.h5").read_bytes() == before
