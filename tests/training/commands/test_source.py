from __future__ import annotations

import click
import numpy as np
import pytest
from scipy.integrate import dblquad
from support.worked_example import run_example

from deepmuon_runtime import read_attributes, read_muons
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.check import check_file
from deepmuon_training.commands.train import train
from deepmuon_training.fluxes.flux import MUON_MASS


@pytest.fixture
def source(tmp_path, monkeypatch, capsys):
    """Run the command: what it prints."""
    monkeypatch.chdir(tmp_path)

    def run(options: str) -> str:
        train.main(["source", *options.split()], prog_name="deepmuon-train", standalone_mode=False)
        return str(capsys.readouterr().out)

    return run


def rate_density(log_p: float, cos_zenith: float) -> float:
    """EcoMug's formula, times cos zenith, per log momentum and cos zenith: the paper's, not the package's."""
    p = np.exp(log_p)
    n = max(0.1, 2.856 - 0.655 * log_p)
    return 2 * np.pi * 1600 * (p + 2.68) ** -3.175 * p**0.279 * cos_zenith**n * cos_zenith * p


def test_the_example_prints_what_its_help_says(tmp_path):
    shown, printed = run_example(tmp_path, "deepmuon-train source")
    assert printed == shown
    assert shown.count("$ ") == 1


def test_the_rate_is_the_integral_of_the_formula_over_a_horizontal_plane(source, tmp_path):
    source("-n 1 -o muons.h5")
    momenta = [np.sqrt(energy * (energy + 2 * MUON_MASS)) for energy in (1e-3, 1.0, 1e5)]
    parts = [dblquad(rate_density, 0, 1, *np.log(momenta[i : i + 2])) for i in (0, 1)]  # n bends near 67 GeV/c
    rate = read_attributes(tmp_path / "muons.h5")["rate_hz_per_m2"]
    assert rate == pytest.approx(sum(part for part, _ in parts), rel=1e-6)


def test_the_file_is_sound_and_says_what_it_is(source, tmp_path):
    out = source("-n 300_000 --seed 7 --charge-ratio 1.5 -o muons.h5")
    assert "300,000 muons" in out
    assert "seed 7" in out
    report = check_file(tmp_path / "muons.h5")
    assert report.defects == []
    # one false alarm in ten thousand
    assert abs(report.mu_plus - 180_000) < 3.9 * np.sqrt(300_000 * 0.6 * 0.4)
    known = read_attributes(tmp_path / "muons.h5")
    assert known["provenance"] == ["300000 muons drawn, 1.5 mu+ for each mu-, seed 7"]
    assert "EcoMug" in known["source"]
    assert known["depth_m"] == 0
    assert known["live_time_s_m2"] == pytest.approx(300_000 / known["rate_hz_per_m2"])


def test_fewer_muons_of_a_seed_are_the_first_of_more_and_no_piece_is_repeated(source, tmp_path):
    source("-n 600_000 --seed 3 -o more.h5")
    source("-n 270_000 --seed 3 -o fewer.h5")
    more, fewer = read_muons(tmp_path / "more.h5"), read_muons(tmp_path / "fewer.h5")
    assert len(fewer) == 270_000
    for name in ("kinetic_energy", "u", "v", "w", "pdg_id"):
        np.testing.assert_array_equal(getattr(fewer, name), getattr(more, name)[:270_000])
    assert len(np.unique(more.u)) > 590_000  # float32 repeats a few


def test_the_charge_ratio_is_1_28_unless_stated(source, tmp_path):
    source("-n 10 -o muons.h5")
    assert "1.28 mu+ for each mu-" in read_attributes(tmp_path / "muons.h5")["provenance"][0]


def test_without_a_seed_every_run_is_another(source, tmp_path):
    for name in ("one", "two"):
        source(f"-n 10 -o {name}.h5")
    one, two = (read_muons(tmp_path / f"{name}.h5").kinetic_energy for name in ("one", "two"))
    assert np.all(one != two)


TABLE = "".join(
    f"{energy},{cosine},{2 * energy**-2 * cosine},{energy**-2 * cosine}\n"
    for cosine in (0.1, 1.0)
    for energy in (1, 5, 50)
)


def test_muons_of_the_measured_flux_have_its_rate_and_its_charges(source, tmp_path):
    source("-n 300_000 --flux measured --seed 1 -o muons.h5")
    known, muons = read_attributes(tmp_path / "muons.h5"), read_muons(tmp_path / "muons.h5")
    assert known["rate_hz_per_m2"] == pytest.approx(130.73, abs=0.01)  # what the study of its fit prints
    assert known["source"] == "flux fitted to BESS-TeV (2004) and L3+C (2004), 1 MeV to 100 TeV"
    assert known["provenance"] == ["300000 muons drawn, charges of the flux, seed 1"]
    assert check_file(tmp_path / "muons.h5").defects == []
    slow = muons.kinetic_energy < 0.3
    positive = [np.mean(muons.charge[of] > 0) for of in (slow, ~slow)]
    assert positive[0] < positive[1] - 0.01  # four standard deviations


def test_muons_of_another_flux_say_whose_they_are(source, tmp_path):
    source("-n 10 --flux gccly --charge-ratio 1.3 -o muons.h5")
    known = read_attributes(tmp_path / "muons.h5")
    assert known["source"] == "flux of Guan et al. (arXiv:1509.06176), 1 MeV to 100 TeV"
    assert "1.3 mu+ for each mu-" in known["provenance"][0]


def test_a_table_is_a_flux_with_its_own_energies_and_charges(source, tmp_path):
    (tmp_path / "mine.csv").write_text(TABLE)
    source("-n 200_000 --flux mine.csv --seed 2 -o muons.h5")
    known, muons = read_attributes(tmp_path / "muons.h5"), read_muons(tmp_path / "muons.h5")
    assert known["source"] == "flux of the table mine.csv, 1 GeV to 50 GeV"
    assert muons.kinetic_energy.min() >= 1
    assert muons.kinetic_energy.max() <= 50
    # one false alarm in ten thousand, each
    assert abs(np.sum(muons.charge > 0) - 2e5 * 2 / 3) < 3.9 * np.sqrt(2e5 * 2 / 9)
    above_5 = (1 / 5 - 1 / 50) / (1 - 1 / 50)
    assert abs(np.sum(muons.kinetic_energy > 5) - 2e5 * above_5) < 3.9 * np.sqrt(2e5 * above_5 * (1 - above_5))


def test_a_table_that_is_read_is_never_replaced(source, tmp_path):
    (tmp_path / "mine.csv").write_text(TABLE)
    with pytest.raises(RefusedError, match="is read here"):
        source("-n 10 --flux mine.csv -o mine.csv --overwrite")
    assert (tmp_path / "mine.csv").read_text() == TABLE


@pytest.mark.parametrize(
    ("table", "options", "reason"),
    [
        (
            "",
            "--flux mesured",
            "no flux and no file 'mesured': expected was measured, gccly, ecomug or a table",
        ),
        ("", "--flux measured --charge-ratio 1.2", "has charges of its own: no charge ratio can be asked of it"),
        (TABLE, "--flux mine.csv --charge-ratio 1.2", "has charges of its own"),
        (TABLE.replace("0.04", "-0.04"), "--flux mine.csv", "has a negative flux"),
        (TABLE.replace("5,1.0,", "6,1.0,"), "--flux mine.csv", "every cos zenith needs the energies of the first"),
        (TABLE.replace("0.04", "nan"), "--flux mine.csv", "has a number that is not finite"),
        ("1e6,0,1,1\n1e7,0,1,1\n1e6,1,1,1\n1e7,1,1,1", "--flux mine.csv", "is of 1e+06 to 1e+07 GeV: expected were"),
    ],
)
def test_what_is_no_flux_is_refused(source, tmp_path, table, options, reason):
    (tmp_path / "mine.csv").write_text(table)
    with pytest.raises(RefusedError) as refusal:
        source(f"-n 10 -o muons.h5 {options}")
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert not (tmp_path / "muons.h5").exists()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ("-o muons.h5", "Missing parameter: number"),
        ("-n 10", "Missing parameter: output"),
        ("-n 1.5 -o muons.h5", "1.5 is not a whole number"),
        ("-n 10 --charge-ratio 0 -o muons.h5", "0 is not a finite number above 0"),
        ("-n 10 --seed -1 -o muons.h5", "-1 is not from 0 to 2^64 - 1"),
        ("-n 10 -o no/muons.h5", "there is no folder"),
        ("-n 10 -o muons.parquet", "muons.parquet would be HDF5 under a name of Parquet"),
        ("-n 10 -o -", "- is no name of a muon file"),
    ],
)
def test_bad_options_are_refused(source, tmp_path, options, reason):
    with pytest.raises((click.UsageError, RefusedError)) as refusal:
        source(options)
    assert reason in str(refusal.value)
    assert not list(tmp_path.iterdir())


def test_an_existing_output_is_replaced_only_where_asked(source, tmp_path):
    (tmp_path / "muons.h5").write_text("precious")
    with pytest.raises(RefusedError, match="exists already"):
        source("-n 10 -o muons.h5")
    assert (tmp_path / "muons.h5").read_text() == "precious"
    assert source("-n 10 -o muons.h5 --overwrite -q") == ""
    assert len(read_muons(tmp_path / "muons.h5")) == 10
