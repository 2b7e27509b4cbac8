from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

import click
import h5py
import numpy as np
import pytest
from support.worked_example import run_example

from deepmuon_runtime import read_attributes, read_muons
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.check import check_file
from deepmuon_training.commands.train import train
from deepmuon_training.fluxes.ecomug import sea_level_muons

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-train"
ROWS = np.array([[2150.0, 0.6, 0.0, -0.8, -1], [830.0, 0.0, -0.28, -0.96, 1], [0.5, 0.0, 0.0, -1.0, 1]])

pytestmark = pytest.mark.filterwarnings("ignore:1 of 3 muons are below 1 MeV")  # the third of them
SHOWER = """\
# nEvent nSecondary KE x y z u v w
 0 0 4 1413.5 0.131664 -0.492707 0 0.26661 0.254994 -0.929461
 1 0 6 4.7737 -0.395969 -0.0585462 0 -0.24014 -0.292081 -0.925755
 3 0 4 21.2691 0.352818 0.00437914 0 0.197489 0.270145 -0.942348
 3 1 4 135.913 0.235634 -0.0520156 0 -0.372526 -0.182654 -0.909869
"""
STATED = {
    "cry-text": "--charge -1 --smooth none",
    "cry-hdf5": "--smooth none",
    "csv": "--columns E,u,v,w,charge --units MeV",
    "npy": "--columns E,u,v,w,charge --units MeV",
}


def write_input(path: Path, form: str, rows: np.ndarray = ROWS) -> None:
    if form == "cry-text":
        path.write_text(SHOWER, encoding="ascii")
    elif form == "csv":
        np.savetxt(path, rows, delimiter=",", header="E,u,v,w,charge")
    elif form == "npy":
        with path.open("wb") as file:
            np.save(file, rows)
    else:
        with h5py.File(path, "w") as file:
            group = file.create_group("muons")
            group.attrs["rate_hz_per_m2"], group.attrs["source"] = 120.0, "CRY 1.7"
            for name, column in zip(
                ("kinetic_energy", "u", "v", "w", "charge"), rows.T.astype(np.float32), strict=True
            ):
                group[name] = column


@pytest.fixture
def convert(tmp_path, monkeypatch, capsys):
    """Run the command on a file of a format: what it prints."""
    monkeypatch.chdir(tmp_path)

    def run(form: str, *options: str, output: str = "muons.h5") -> str:
        if not Path("input").exists():
            write_input(Path("input"), form)
        words = " ".join(["convert", "input", "--format", form, "-o", output, *options]).split()
        train.main(words, prog_name="deepmuon-train", standalone_mode=False)
        return str(capsys.readouterr().out)

    return run


@pytest.fixture
def refuse(convert, tmp_path):
    """Run the command, which refuses and leaves nothing behind: why, in one line."""

    def run(form: str, *options: str) -> str:
        with pytest.raises((click.UsageError, RefusedError)) as refusal:
            convert(form, *options)
        assert [path.name for path in tmp_path.iterdir()] == ["input"]
        error = refusal.value
        reason = error.format_message() if isinstance(error, click.UsageError) else str(error)
        assert "\n" not in reason
        return reason

    return run


def test_the_example_prints_what_its_help_says(tmp_path):
    shown, printed = run_example(tmp_path, "deepmuon-train convert")
    assert [line.strip() for line in printed.splitlines()] == shown.splitlines()
    assert shown.count("$ ") == 3


@pytest.mark.parametrize("form", STATED)
def test_every_format_becomes_a_sound_muon_file(convert, tmp_path, form):
    out = convert(form, STATED[form])
    report = check_file(tmp_path / "muons.h5")
    assert report.defects == []
    expected = 3 if form == "cry-text" else 2
    assert report.examined == expected
    assert out.startswith(f"muons.h5: {expected} muons, ")


def test_crys_text_with_a_live_time_has_its_rate_and_says_what_was_done(convert, tmp_path):
    convert("cry-text", "--charge 1.2 --seed 5 --smooth none --live-time 2 --area 0.5")
    known = read_attributes(tmp_path / "muons.h5")
    assert known["rate_hz_per_m2"] == 3.0
    assert known["rate_uncertainty_hz_per_m2"] == pytest.approx(5**0.5)  # showers of one and of two muons
    assert (known["source"], known["smoothed"], known["depth_m"], known["medium"]) == ("CRY", False, 0, "G4_WATER")
    assert known["provenance"] == [
        "input, CRY's text output: 3 muons",
        "rate from 3 muons in 2 s on 0.5 m2",
        "charge drawn: 1.2 mu+ for each mu-, seed 5",
    ]


def test_a_table_says_what_was_stated_of_it(convert, tmp_path):
    stated = ("--depth 12.5 --medium G4_CONCRETE", "--source tunnel --rate 7.5 --rate-uncertainty 0.25")
    with pytest.warns(UserWarning, match="1 of 3 muons are below 1 MeV, and dropped: are the energies in GeV, and not"):
        out = convert("csv", STATED["csv"], *stated)
    told = [
        "input, columns E [MeV], u, v, w, charge: 3 rows",
        "1 of 3 muons below 1 MeV dropped",
        "rate stated: 7.5 +- 0.25 per m2 and s",
    ]
    assert out.splitlines() == [
        "muons.h5: 2 muons, 1 mu+ and 1 mu-, mean kinetic energy 1.49 GeV, rate 7.50 +- 0.25 per m2 and s",
        *(f"    {line}" for line in told),
    ]
    known = read_attributes(tmp_path / "muons.h5")
    assert (known["depth_m"], known["medium"], known["source"]) == (12.5, "G4_CONCRETE", "tunnel")
    assert (known["rate_hz_per_m2"], known["rate_uncertainty_hz_per_m2"]) == (7.5, 0.25)
    assert "smoothed" not in known
    assert known["provenance"] == told


def test_a_rate_that_is_not_stated_stays_unknown(convert, tmp_path):
    assert convert("npy", STATED["npy"]).splitlines()[0].endswith("rate unknown")
    assert {"rate_hz_per_m2", "rate_uncertainty_hz_per_m2", "live_time_s_m2"}.isdisjoint(
        read_attributes(tmp_path / "muons.h5")
    )


def test_a_minus_before_a_column_turns_it_round(convert, tmp_path):
    write_input(tmp_path / "input", "csv", ROWS * [1, -1, -1, -1, 1])
    convert("csv", "--columns E,-u,-v,-w,charge --units GeV")
    muons = read_muons(tmp_path / "muons.h5")
    np.testing.assert_allclose(np.stack([muons.u, muons.v, muons.w]).T, ROWS[:, 1:4], atol=1e-6)
    np.testing.assert_allclose(muons.kinetic_energy, ROWS[:, 0])


def test_crys_steps_are_taken_out_where_asked(convert, tmp_path):
    muons = sea_level_muons(100_000, seed=1)
    rows = np.stack([1e3 * muons.kinetic_energy, muons.u, muons.v, muons.w, muons.charge]).T
    write_input(tmp_path / "input", "cry-hdf5", rows)
    convert("cry-hdf5", "--smooth cry", output="smooth.h5")
    convert("cry-hdf5", "--smooth none", output="raw.h5")
    smooth, raw = (read_attributes(tmp_path / f"{name}.h5") for name in ("smooth", "raw"))
    assert (smooth["smoothed"], raw["smoothed"]) == (True, False)
    assert "steps of CRY's tables taken out" in smooth["provenance"][-1]
    assert len(raw["provenance"]) == 1
    assert check_file(tmp_path / "smooth.h5").defects == []
    found, expected = read_muons(tmp_path / "smooth.h5"), read_muons(tmp_path / "raw.h5")
    assert np.mean(np.isin(found.kinetic_energy, expected.kinetic_energy)) < 0.1
    cells = 10 ** np.arange(-1, 2, 0.2)
    kept = np.histogram(found.kinetic_energy, cells)[0] / np.histogram(expected.kinetic_energy, cells)[0]
    np.testing.assert_allclose(kept, 1, atol=0.01)


@pytest.mark.parametrize(
    ("form", "options", "reason"),
    [
        ("cry-text", "--smooth none", "give --charge"),
        ("cry-text", "--charge -1", "give --smooth"),
        ("cry-text", "--charge 1 --smooth none", "1 can be read in two ways"),
        ("cry-text", "--charge -2 --smooth none", "-2 is not a finite number above 0"),
        ("cry-text", "--charge nan --smooth none", "nan is not a finite number above 0"),
        ("cry-text", "--charge -1 --smooth none --units MeV", "--units goes without --format cry-text"),
        ("cry-text", "--charge -1 --smooth none --depth 5", "--depth goes without --format cry-text"),
        ("cry-text", "--charge -1 --smooth cry", "too few to take the steps of CRY's tables out"),
        ("cry-hdf5", "", "give --smooth"),
        ("cry-hdf5", "--smooth none --charge 1.2", "--charge goes without --format cry-hdf5"),
        ("cry-hdf5", "--smooth none --rate 1", "--rate goes without --format cry-hdf5"),
        ("csv", "--units MeV", "the column 'E' can be E or Etot: say which by --columns"),
        ("csv", "--columns E,u,v,w,charge", "input does not say the unit of E: give --units"),
        ("csv", "--columns E,v,u,w,charge --units MeV", "input calls column 2 'u', and --columns says v"),
        ("csv", "--columns u=u,v=v,E=Ekin --units MeV", "input has no column 'Ekin' for E, but E, u, v, w, charge"),
        ("csv", f"{STATED['csv']} --angles deg", "--angles deg goes with angles"),
        ("csv", f"{STATED['csv']} --muons-only", "--muons-only goes with a column pdg_id"),
        ("npy", "--columns E,u,v,w,weight --units MeV --charge -1 --live-time 3 --area 1", "--live-time counts muons"),
        ("npy", "--units MeV", "give --columns"),
        ("csv", "--columns E,u,v,w,q --units MeV", "there is no column 'q'"),
        ("csv", "--columns E,u,v,w,skip --units MeV", "give either a column charge or pdg_id, or --charge"),
        ("npy", f"{STATED['npy']} --charge -1", "give either a column charge or pdg_id, or --charge"),
        ("npy", f"{STATED['npy']} --live-time 3", "--live-time and --area go together"),
        ("npy", f"{STATED['npy']} --live-time 3 --area 1 --rate 1", "--rate goes without --live-time"),
        ("npy", f"{STATED['npy']} --rate-uncertainty 1", "--rate-uncertainty goes with --rate"),
        ("npy", f"{STATED['npy']} --depth -1", "-1 is not a finite number of 0 or more"),
        ("npy", f"{STATED['npy']} --depth 1 --smooth cry", "--smooth cry is for sea level"),
        ("mcpl", "", "input can't be read as an MCPL file"),
        ("root", "", "input can't be read as a ROOT file"),
        ("npy", f"{STATED['npy']} --seed 1.5", "1.5 is not a whole number"),
        ("npy", "--columns E,u,v,w --units MeV --charge -1", "input has 5 columns, and --columns names 4"),
        ("csv", "--columns E,u,v,w --units MeV --charge -1", "input, line 2: "),
        ("csv", "--columns E,u,v,-w,charge --units MeV", "input, line 2: the muon does not go down"),
        ("csv", f"{STATED['csv']} -o input --overwrite", "input is read here, and would be replaced"),
    ],
)
def test_what_is_not_stated_or_contradicts_itself_is_refused(refuse, form, options, reason):
    assert reason in refuse(form, options)


BROKEN = {
    "empty": lambda path: path.write_bytes(b""),
    "header": lambda path: path.write_text("E,u,v,w,charge\n", encoding="ascii"),
    "text": lambda path: path.write_text("2150 0.6 0\nmuons\n", encoding="ascii"),
    "bytes": lambda path: path.write_bytes(bytes(range(256)) * 20),
    "folder": Path.mkdir,
    "hdf5": lambda path: h5py.File(path, "w").close(),
}


@pytest.mark.parametrize("kind", BROKEN)
@pytest.mark.parametrize("form", STATED)
def test_a_broken_file_is_refused_in_one_line(refuse, tmp_path, form, kind):
    BROKEN[kind](tmp_path / "input")
    assert "input" in refuse(form, STATED[form])


@pytest.mark.parametrize("form", STATED)
def test_a_truncated_file_is_refused(refuse, tmp_path, form):
    write_input(tmp_path / "input", form)
    whole = (tmp_path / "input").read_bytes()
    (tmp_path / "input").write_bytes(whole[: len(whole) // 2 + 3])
    assert "input" in refuse(form, STATED[form])


def test_a_refusal_ends_the_command_with_2_and_one_line(tmp_path):
    (tmp_path / "input").mkdir()
    words = f"convert input --format npy {STATED['npy']} -o muons.h5".split()
    done = subprocess.run([COMMAND, *words], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "deepmuon-train: input can't be read as an NPY file: Is a directory\n"


def test_an_existing_output_is_replaced_only_where_asked(convert, tmp_path):
    (tmp_path / "muons.h5").write_text("precious")
    with pytest.raises(RefusedError, match="exists already"):
        convert("csv", STATED["csv"])
    assert (tmp_path / "muons.h5").read_text() == "precious"
    assert convert("csv", STATED["csv"], "--overwrite -q") == ""
    assert len(read_muons(tmp_path / "muons.h5")) == 2


@pytest.mark.parametrize("output", ["muons.csv", "muons.root", "-"])
def test_an_output_that_promises_what_is_not_hdf5_is_refused(convert, tmp_path, output):
    with pytest.raises(RefusedError, match=r"would be HDF5 under a name of|- is no name of a muon file"):
        convert("csv", STATED["csv"], output=output)
    assert [path.name for path in tmp_path.iterdir()] == ["input"]
