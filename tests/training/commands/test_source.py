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
from deepmuon_training.data.ecomug import MUON_MASS


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
