from __future__ import annotations

from dataclasses import replace

import pytest

from deepmuon_runtime import Model
from deepmuon_runtime.muon_file.attributes import attribute_defects, sound_attributes

MODEL = Model(
    name="quantile-10m.onnx",
    sha256="0" * 64,
    size=1,
    architecture="quantile",
    depth_m=10.0,
    medium="G4_WATER",
    muons_per_draw=1,
    latent_size=5,
    energy_min_gev=0.001,
    energy_max_gev=1e5,
    created_by="a test",
    licence="BSD-3-Clause",
    flux="cry",
    surface=0,
    depth_min_m=None,
    depth_max_m=None,
    rate_hz_per_m2=50.0,
    rate_uncertainty_hz_per_m2=0.1,
    rate_relative_uncertainty=None,
    energy_latents=None,
    metadata={},
)
ALWAYS = {
    "count": 100,
    "depth_m": 10.0,
    "medium": "G4_WATER",
    "created": "2025-12-31T23:59:59+00:00",
    "created_by": "a test",
    "rate_hz_per_m2": 50.0,
    "rate_uncertainty_hz_per_m2": 0.1,
    "live_time_s_m2": 2.0,
}
GENERATED = {
    **ALWAYS,
    "seed": 2**64 - 1,
    "first": 100,
    "total": 300,
    "shard": "2/3",
    "model_sha256": "0" * 64,
    "architecture": "quantile",
    "device": "cpu",
    "command_line": "deepmuon-gen",
    "live_time_s": 1.0,
    "area_m2": 6.0,
}
CONVERTED = {**ALWAYS, "source": "CRY 1.7, µ only", "provenance": ["read", "smoothed"], "smoothed": True}


@pytest.mark.parametrize("attributes", [GENERATED, CONVERTED, {**CONVERTED, "remark": object()}])
def test_good_attributes_have_no_defect(attributes):
    assert list(attribute_defects(attributes, None)) == []
    assert sound_attributes(attributes).keys() == attributes.keys() - {"remark"}


def test_the_attributes_of_a_released_model_are_its_own():
    assert list(attribute_defects(GENERATED, MODEL)) == []
    other = replace(MODEL, depth_m=0.0, rate_hz_per_m2=None)
    assert list(attribute_defects(GENERATED, other)) == [
        "the attribute depth_m is 10.0, and that of its model quantile-10m.onnx is 0.0",
        "the attribute rate_hz_per_m2 is 50.0, and that of its model quantile-10m.onnx is None",
    ]


def test_a_flux_is_compared_where_the_file_and_its_model_say_one():
    stated = replace(MODEL, metadata={"flux": "cry"})
    other = {**GENERATED, "flux": "measured"}
    assert list(attribute_defects(GENERATED, stated)) == []
    assert list(attribute_defects({**GENERATED, "flux": "cry"}, stated)) == []
    assert list(attribute_defects(other, MODEL)) == []
    assert list(attribute_defects(other, stated)) == [
        "the attribute flux is 'measured', and that of its model quantile-10m.onnx is 'cry'"
    ]


NOT_NEEDED = {"rate_uncertainty_hz_per_m2", "command_line"}


@pytest.mark.parametrize("name", sorted(GENERATED.keys() - NOT_NEEDED))
def test_a_generated_file_has_all_attributes(name):
    (defect,) = attribute_defects({key: value for key, value in GENERATED.items() if key != name}, None)
    assert name in defect


@pytest.mark.parametrize("name", ["source", "provenance"])
def test_a_converted_file_has_all_attributes(name):
    lacking = {key: value for key, value in CONVERTED.items() if key != name}
    assert list(attribute_defects(lacking, None)) == [f"the attribute {name} is missing"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("count", -1),
        ("count", 1.5),
        ("count", True),
        ("count", "100"),
        ("depth_m", -1.0),
        ("depth_m", float("nan")),
        ("depth_m", [10.0]),
        ("medium", ""),
        ("medium", "water\x1b[2J"),
        ("created", "yesterday"),
        ("created", "2025-12-31T23:59:59+01:00"),
        ("created", "2025-12-31T23:59:59"),
        ("created_by", b"bytes"),
        ("seed", 2**64),
        ("shard", "0/3"),
        ("shard", "4/3"),
        ("shard", "02/3"),
        ("shard", "second"),
        ("model_sha256", "0" * 63),
        ("model_sha256", "G" * 64),
        ("device", "abacus"),
        ("rate_hz_per_m2", -1.0),
        ("rate_hz_per_m2", float("inf")),
        ("rate_uncertainty_hz_per_m2", -1.0),
        ("area_m2", 0),
    ],
)
def test_a_value_that_can_not_be_is_a_defect(name, value):
    spoilt = {**GENERATED, name: value}
    assert name not in sound_attributes(spoilt)
    defects = list(attribute_defects(spoilt, None))
    assert defects[0].startswith(f"the attribute {name} is ")
    assert all(line.isprintable() and len(line) < 200 for line in defects)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"first": 99}, "the muons are numbers 99 to 199 (without the end) of 300 by first and count, and 100 to 200"),
        ({"total": 310}, "and 103 to 206 by shard 2/3"),
        ({"shard": "1/3"}, "and 0 to 100 by shard 1/3"),
        ({"live_time_s_m2": 2.0001}, "live_time_s_m2 is 2.0001, and count / rate_hz_per_m2 is 2.0"),
    ],
)
def test_values_that_contradict_each_other_are_a_defect(changes, reason):
    (defect,) = attribute_defects({**GENERATED, **changes}, None)
    assert reason in defect
