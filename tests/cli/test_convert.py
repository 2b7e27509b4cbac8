from __future__ import annotations

import gzip
import json
import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from support.worked_example import run_example

from deepmuon_runtime import Generator, Muons, check_file, read_attributes, read_muons, write_muons

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-convert"
MUONS = 70_001


@pytest.fixture
def convert(tmp_path, model_file):
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
    shown, printed = run_example(tmp_path, "deepmuon-convert")
    assert printed == shown
    assert shown.count("$ ") == 6


def test_every_muon_is_in_the_text_to_the_last_bit(convert, tmp_path):
    assert convert("muons.h5", "muons.csv") == (0, "", "")
    text = (tmp_path / "muons.csv").read_text(encoding="ascii")
    assert "\nkinetic_energy_GeV,u,v,w,pdg_id\n" in text
    muons = read_muons(tmp_path / "muons.h5")
    for name, found in zip(("kinetic_energy", "u", "v", "w", "pdg_id"), columns(text), strict=True):
        np.testing.assert_array_equal(found, getattr(muons, name))


def test_comments_say_what_the_file_says(convert, tmp_path):
    comments = [line for line in convert("muons.h5", "-")[1].splitlines() if line.startswith("#")]
    said = {name: json.loads(value) for name, value in (line[2:].split(" = ", 1) for line in comments)}
    del said["attributes_crc32"]
    assert said == {"format": "deepmuon-muons", "format_version": 2, **read_attributes(tmp_path / "muons.h5")}


def test_units_and_header_are_as_asked_for(convert):
    gev, mev = (convert("muons.h5", "-", "--no-header", "--units", unit)[1] for unit in ("GeV", "MeV"))
    assert gev[0].isdigit()
    np.testing.assert_allclose(columns(mev)[0], 1000 * columns(gev)[0], rtol=1e-6)
    np.testing.assert_array_equal(columns(mev)[1:], columns(gev)[1:])


@pytest.mark.parametrize("name", ["csv", "csv.gz", "mcpl", "mcpl.gz", "root"])
def test_there_and_back_they_are_the_same_muons(convert, tmp_path, name):
    units = ["--units", "MeV"] if "csv" in name else []
    assert convert("muons.h5", f"muons.{name}", *units) == (0, "", "")
    assert convert(f"muons.{name}", "back.h5") == (0, "", "")
    assert check_file(tmp_path / "back.h5").defects == []
    first, second = (read_muons(tmp_path / f"{file}.h5") for file in ("muons", "back"))
    for column, values in first.columns.items():
        np.testing.assert_allclose(second.columns[column], values, rtol=1e-6, atol=1e-6 if "mcpl" in name else 0)
    one, two = (read_attributes(tmp_path / f"{file}.h5") for file in ("muons", "back"))
    assert {**one, "created": ""} == {**two, "created": ""}


@pytest.mark.parametrize("name", ["csv", "mcpl", "root"])
def test_flux_and_medium_go_along(convert, tmp_path, family_file, name):
    Generator.open(13.7, file=family_file).write(tmp_path / "family.h5", 100, seed=1)
    assert convert("family.h5", f"family.{name}") == (0, "", "")
    attributes = check_file(tmp_path / f"family.{name}").attributes
    assert (attributes["flux"], attributes["medium"], attributes["depth_m"]) == ("test", "water", 13.7)


def test_the_format_is_that_asked_for_where_the_name_says_none(convert, tmp_path):
    assert convert("muons.h5", "muons.dat", "--format", "csv.gz", "--no-header") == (0, "", "")
    text = gzip.decompress((tmp_path / "muons.dat").read_bytes()).decode()
    assert text == convert("muons.h5", "-", "--no-header")[1]


def test_stdout_gets_what_a_file_gets_but_for_the_checksum_at_its_end(convert, tmp_path):
    convert("muons.h5", "muons.csv")
    lines = (tmp_path / "muons.csv").read_text(encoding="ascii").splitlines()
    code, out, err = convert("muons.h5", "-")
    assert (code, err) == (0, "")
    others = "# crc32 = ", "# created = ", "# attributes_crc32 = "
    there, here = (sorted(line for line in text if not line.startswith(others)) for text in (lines, out.splitlines()))
    assert there == here


@pytest.mark.parametrize("name", ["h5", "csv", "mcpl.gz", "root"])
def test_a_reader_that_goes_ends_the_command_silently(convert, tmp_path, name):
    if name != "h5":
        convert("muons.h5", f"muons.{name}")
    done = subprocess.run(
        f"'{COMMAND}' muons.{name} - | grep -m 1 kinetic; exit ${{PIPESTATUS[0]}}",
        shell=True,
        executable="/bin/bash",
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stdout, done.stderr) == (141, "kinetic_energy_GeV,u,v,w,pdg_id\n", "")


@pytest.mark.parametrize("name", ["h5", "csv", "mcpl.gz", "root"])
def test_a_full_disk_is_a_failure_of_the_output_whatever_is_read(convert, tmp_path, name):
    if name != "h5":
        convert("muons.h5", f"muons.{name}")
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [COMMAND, f"muons.{name}", "-"], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120
        )
    assert done.returncode == 1
    assert done.stderr == "deepmuon-convert: stdout was not written to its end: No space left on device\n"


def test_a_file_of_no_muon_is_a_header(convert, tmp_path):
    write_muons(tmp_path / "none.h5", Muons.empty(0), {"depth_m": 0.0, "medium": "G4_WATER"})
    code, out, err = convert("none.h5", "-")
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == '# format = "deepmuon-muons"'
    assert out.splitlines()[-1] == "kinetic_energy_GeV,u,v,w,pdg_id"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["missing.h5", "muons.csv"], "missing.h5 can't be read"),
        (
            ["text.h5", "muons.csv"],
            "text.h5 can't be read as a muon file: it is no HDF5; deepmuon-convert makes that",
        ),
        (["other.csv", "back.h5"], "other.csv can't be read"),
        (["muons.h5"], "Missing argument 'OUT'"),
        (["muons.h5", "no/muons.csv"], "there is no folder"),
        (["muons.h5", "."], "is a folder"),
        (["muons.h5", f"{'a' * 300}.csv"], "can't be written: File name too long"),
        (["a" * 300, "muons.csv"], "can't be read as a muon file: File name too long"),
        (["muons.h5", "muons.csv", "--units", "keV"], "'keV' is not one of"),
        (["muons.h5", "muons.mcpl", "--units", "MeV"], "--units and --no-header are for text, and muons.mcpl is of"),
        (["muons.h5", "muons.root", "--no-header"], "--units and --no-header are for text, and muons.root is of"),
        (["muons.h5", "muons.root", "--format", "mcpl"], "is the name of a file of the format root, and --format asks"),
        (["muons.h5", "-", "--format", "mcpl"], "stdout takes text alone, and --format asks for mcpl"),
        (["muons.h5", "muons.parquet"], "muons.parquet would be HDF5 under a name of Parquet"),
    ],
)
def test_what_can_t_be_done_is_refused_and_leaves_nothing(convert, tmp_path, arguments, reason):
    (tmp_path / "text.h5").write_text("no HDF5")
    (tmp_path / "other.csv").write_text("1,2,3\n")
    before = sorted(tmp_path.iterdir())
    code, out, err = convert(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("deepmuon-convert: ")
    assert err.count("\n") == 1
    assert reason in err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("output", ["damaged.csv", "damaged.mcpl", "damaged.root", "-"])
def test_of_a_damaged_file_nothing_is_written(convert, tmp_path, output):
    convert("muons.h5", "muons.csv")
    text = (tmp_path / "muons.csv").read_text()
    (tmp_path / "muons.csv").write_text(text[:-4] + "3\n" if text.endswith("-13\n") else text[:-3] + "-13\n")
    code, out, err = convert("muons.csv", output)
    assert (code, out) == (2, "")
    assert err.startswith("deepmuon-convert: muons.csv is damaged: ")
    assert not (tmp_path / output).exists()


def test_an_existing_output_is_replaced_only_where_asked(convert, tmp_path):
    (tmp_path / "muons.csv").write_text("precious")
    assert convert("muons.h5", "muons.csv")[0] == 2
    assert (tmp_path / "muons.csv").read_text() == "precious"
    assert convert("muons.h5", "muons.csv", "--overwrite") == (0, "", "")
    assert columns((tmp_path / "muons.csv").read_text()).shape == (5, MUONS)


def test_the_file_itself_is_never_replaced(convert, tmp_path):
    before = (tmp_path / "muons.h5").read_bytes()
    (tmp_path / "link.h5").symlink_to("muons.h5")
    for output in ("muons.h5", "link.h5"):
        code, out, err = convert("muons.h5", output, "--overwrite")
        assert (code, out) == (2, "")
        assert f"{output} is read here, and would be replaced" in err
    assert (tmp_path / "muons.h5").read_bytes() == before
