from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.learning.descent import Schedule
from deepmuon_training.pipeline.settings import PipelineSettings, read_pipeline_settings
from deepmuon_training.pipeline.settings_file import settings_from, to_toml

POSITIVE = st.integers(1, 10**6)
FRACTION = st.floats(1e-9, 1, exclude_max=True)
SCHEDULES = st.builds(Schedule, POSITIVE, FRACTION, FRACTION, FRACTION, POSITIVE, POSITIVE)
TEXT = st.text(st.characters(exclude_categories=["Cs"]), min_size=1)
FITS = PipelineSettings().fits
SETTINGS = st.builds(
    lambda azimuth, kind, **values: PipelineSettings(
        **values, **kind, fits={**FITS, "quantile": replace(FITS["quantile"], azimuth=azimuth)}
    ),
    SCHEDULES,
    st.sampled_from([{"azimuth": "uniform"}, {"azimuth": "learned"}, {"architecture": "transformer"}]),
    layers=st.integers(0, 100),
    layer_m=st.floats(0, 1e4, exclude_min=True),
    material=TEXT,
    density=st.none() | st.floats(1e-3, 30),
    direct=st.booleans(),
    seed=st.integers(0, 2**64 - 1),
)


@given(SETTINGS)
def test_settings_come_back_as_they_were_written(settings: PipelineSettings):
    assert settings_from(PipelineSettings(), tomllib.loads(to_toml(settings)), "test") == settings


@pytest.fixture
def read(tmp_path: Path):
    """Read settings from a text."""

    def read(text: str) -> PipelineSettings:
        (tmp_path / "run.toml").write_text(text)
        return read_pipeline_settings(tmp_path / "run.toml")

    return read


def test_what_is_not_stated_keeps_its_default(read):
    assert read("") == PipelineSettings()
    found = read("layers = 2\nmuons = 1e6\n[quantile]\nazimuth = {steps = 7}\n[transformer.schedule]\npatience = 3")
    assert (found.layers, found.muons, type(found.muons)) == (2, 1_000_000, int)
    assert found.fits["quantile"].azimuth == replace(FITS["quantile"].azimuth, steps=7)
    assert found.fits["transformer"].schedule == replace(FITS["transformer"].schedule, patience=3)
    assert (found.layer_m, found.fits["transformer"].charge) == (10.0, FITS["transformer"].charge)


def test_the_fit_is_that_of_the_architecture(read):
    assert read("").fit == FITS["quantile"]
    assert read('architecture = "transformer"').fit == FITS["transformer"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("layer_depth = 3", "unknown key 'layer_depth'; the nearest known one is 'layer_m'"),
        ("seeds = 3", "unknown key 'seeds'; the nearest known one is 'seed'"),
        ("[quantile.azimut]\nsteps = 3", "quantile: unknown key 'azimut'; the nearest known one is 'azimuth'"),
        ('"two\\nlines" = 1', "unknown key 'two\\nlines'; the nearest known one is '"),
        ("muons = 1234.5", "muons is 1234.5, and should be a whole number"),
        ("muons = inf", "muons is inf, and should be a whole number"),
        ("muons = 100", "muons is 100, and should be from 3,000 to"),
        ("layers = true", "layers is True, and should be a whole number"),
        ("layers = -1", "layers is -1, and should be from 0 to 1,000"),
        ("layers = 100_000_000", "layers is 100000000, and should be from 0 to 1,000"),
        ("layer_m = nan", "layer_m is nan, and should be a finite number"),
        ("layer_m = 0", "layer_m is 0.0, and should be above 0"),
        ("muons_per_part = 0", "muons_per_part is 0, and should be from 1"),
        ("scored_muons = 1", "scored_muons is 1, and should be from 100,000"),
        ('material = "G4_WATR"', "Geant4 knows no material G4_WATR: there are for instance G4_WATER"),
        ("density = 100", "density is 100.0, and should be from 1e-06 to 30"),
        ('architecture = "transformer"\nazimuth = "learned"', "a transformer always learns it, leave it out"),
        ("[quantile.azimuth]\nsteps = -5", "quantile: azimuth: steps is -5, and should be from 1"),
        ("[transformer.charge]\nlearning_rate = -1e-3", "charge: learning_rate is -0.001, and should be above 0"),
        ("[transformer.schedule]\naveraging = 1", "schedule: averaging is 1.0, and should be at least 0 and below 1"),
        ("[transformer]\ncalibration = 0", "transformer: calibration is 0, and should be from 1,000"),
        ("[transformer]\ndirections = 0", "transformer: directions is 0, and should be from 1"),
        ("direct = 1", "direct is 1, and should be true or false"),
        ('architecture = "transformer"\nfamily = true', "family is true, which needs an architecture that"),
        ('azimuth = "learned"\nfamily = true', "family is true, which needs"),
        ("layers = 0\nfamily = true", "family is true, which needs"),
        ("material = 3", 'material is 3, and should be a text in "quotes"'),
        ('architecture = "flow"', "architecture is 'flow', and should be quantile or transformer"),
        ('azimuth = "even"', "azimuth is 'even', and should be 'uniform' or 'learned'"),
        ("seed = -1", "seed is -1, and should be from 0"),
        ("seed = 18446744073709551616", "should be from 0 to 18,446,744,073,709,551,615"),
        ("quantile = 3", "quantile is 3, and should be a table"),
        ("[transformer]\nd = 9", "transformer: d is 9, and should be a multiple of 8"),
        ("layers", "is no TOML file: "),
        ("layers = 1\nlayers = 2", "is no TOML file: "),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(read, text, complaint):
    with pytest.raises(RefusedError) as refusal:
        read(text)
    assert complaint in str(refusal.value)
    assert "run.toml" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path):
    (tmp_path / "latin.toml").write_bytes(b'material = "\xe9"')
    for name in (".", "missing.toml", "latin.toml"):
        with pytest.raises(RefusedError):
            read_pipeline_settings(tmp_path / name)


@pytest.mark.parametrize(("name", "layers"), [("examples/pipeline/small.toml", 2), ("models/layered.toml", 5)])
def test_the_settings_that_come_along_can_be_read(name: str, layers: int):
    assert read_pipeline_settings(Path(__file__).parents[3] / name).layers == layers


def test_every_number_of_all_settings_has_a_range():
    def unlimited(kind: type) -> list[str]:
        hints = get_type_hints(kind, include_extras=True)
        return [name for name, hint in hints.items() if hint in (int, float, float | None)]

    for kind in (PipelineSettings, Schedule, *map(type, FITS.values())):
        assert unlimited(kind) == []
