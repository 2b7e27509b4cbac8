from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper
from support.tiny_families import tiny_family
from support.tiny_models import METADATA, tiny_model

from deepmuon_runtime import Generator, RefusedError
from deepmuon_runtime.model.baking import bake
from deepmuon_runtime.model.family import with_metadata


def refusal(folder: Path, content: bytes) -> str:
    path = folder / "model.onnx"
    path.write_bytes(content)
    with pytest.raises(RefusedError, match=r"model\.onnx") as refused:
        Generator.open(file=path)
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize(
    ("edits", "reason"),
    [
        ({"4] latent)": "4] noise)", "Clip(latent": "Clip(noise"}, "inputs are noise, and should be latent"),
        ({"kinetic_energy": "energy_gev"}, "outputs are energy_gev, direction, charge"),
        ({", int8[muons] charge)": ")"}, "outputs are kinetic_energy, direction, and"),
        ({"int8[muons] charge": "int32[muons] charge", "to = 3": "to = 6"}, "charge is tensor(int32)"),
        ({"float[draws, 4] latent": "float[draws, 5] latent"}, "latent is tensor(float) ['draws', 5]"),
        ({"float[draws, 4] latent": "float[16, 4] latent"}, "latent is tensor(float) [16, 4]"),
        ({"float[draws, 4] latent": "float[rows, 4] latent"}, "latent is tensor(float) ['rows', 4]"),
        ({"[muons] k": "[muons, 1] k", "Exp(log_energy)": "Unsqueeze(log_energy, last)"},
         "kinetic_energy is tensor(float) ['muons', 1]"),
    ],
)  # fmt: skip
def test_a_model_with_other_inputs_or_outputs_is_refused(tmp_path, edits, reason):
    message = refusal(tmp_path, tiny_model(edits=edits))
    assert "breaks the contract" in message
    assert reason in message


@pytest.mark.parametrize("key", [key for key in METADATA if "rate" not in key])
def test_a_model_that_lacks_a_key_is_refused(tmp_path, key):
    assert f"lacks deepmuon.{key}" in refusal(tmp_path, tiny_model(metadata={key: None}))


@pytest.mark.parametrize(
    ("key", "value", "meaning"),
    [
        ("contract_version", "3", "1 or 2 for this release"),
        ("contract_version", "one", "1 or 2 for this release"),
        ("created_by", "", "a text"),
        ("architecture", "", "a name"),
        ("architecture", "q\x1b[2J", "a name"),
        ("medium", "G4\nWATER", "a name"),
        ("medium", "G4\0WATER", "a name"),
        ("depth_m", "-1", "a number from 0 on"),
        ("depth_m", "nan", "a number from 0 on"),
        ("muons_per_draw", "0", "a whole number from 1 to 131072"),
        ("muons_per_draw", "1.5", "a whole number from 1 to 131072"),
        ("muons_per_draw", "131073", "a whole number from 1 to 131072"),
        ("latent_size", "1048577", "a whole number from 1 to 1048576"),
        ("energy_min_gev", "0", "a positive number"),
        ("energy_min_gev", "1e-60", "a positive number from 1.18e-38"),
        ("energy_max_gev", "inf", "a positive number"),
        ("energy_max_gev", "1e300", "a positive number from 1.18e-38 to 3.4e+38"),
        ("rate_hz_per_m2", "-3", "a positive number"),
        ("rate_hz_per_m2", "1e-310", "a positive number from 1.18e-38"),
        ("rate_uncertainty_hz_per_m2", "unknown", "a number from 0 on"),
    ],
)
def test_a_model_with_an_impossible_value_is_refused(tmp_path, key, value, meaning):
    message = refusal(tmp_path, tiny_model(metadata={key: value}))
    assert f"deepmuon.{key} is {value!r}, and should be {meaning}" in message


def test_an_empty_range_of_energy_is_refused(tmp_path):
    assert "energy_min_gev is not below" in refusal(tmp_path, tiny_model(metadata={"energy_min_gev": "100"}))


@pytest.mark.parametrize(
    ("edits", "fault"),
    [
        ({"Exp(log_energy)": "Identity(log_energy)"}, "kinetic energy outside"),
        ({"Exp(log_energy)": "Sqrt(log_energy)"}, "kinetic energy outside"),
        ({"float three = {3}": "float three = {5}"}, "kinetic energy outside"),
        ({"u = Mul(sine": "u = Mul(cosine"}, "length is not 1"),
        ({"float middle = {0.55}": "float middle = {0.3}"}, "does not go down"),
        ({"Where(positive, one, minus_one)": "Where(positive, one, zero)"}, "charge other than"),
        ({"Where(positive, one, minus_one)": "Where(positive, three, minus_one)"}, "charge other than"),
    ],
)  # fmt: skip
def test_a_model_that_gives_bad_muons_at_once_is_refused(tmp_path, edits, fault):
    message = refusal(tmp_path, tiny_model(edits=edits))
    assert "breaks the contract in a trial" in message
    assert fault in message


def test_a_model_that_gives_another_number_of_muons_is_refused(tmp_path):
    content = tiny_model(metadata={"muons_per_draw": "2"})
    assert "gave 5 energies, 5 directions and 5 charges, and should give 10" in refusal(tmp_path, content)


def test_a_model_that_fails_to_run_is_refused(tmp_path):
    """It wants an even number of draws."""
    in_pairs = {
        "int64[1] last": "int64[2] per_pair = {-1, 8}, int64[1] last",
        "each = ": "pairs = Reshape(clipped, per_pair)\neach = ",
        "Reshape(clipped, per_muon)": "Reshape(pairs, per_muon)",
    }
    message = refusal(tmp_path, tiny_model(edits=in_pairs))
    assert "breaks the contract in a trial: the model" in message
    assert "failed" in message


@pytest.mark.parametrize("text", [b"0.01", b"energy_min_gev", b"latent", b"direction"])
def test_a_text_that_is_no_utf8_is_refused(tmp_path, text):
    content = tiny_model()
    assert "UTF-8" in refusal(tmp_path, content.replace(text, b"\xff" * len(text)))


@pytest.mark.parametrize("content", [b"", b"no ONNX", bytes(1000), tiny_model()[:-100]])
def test_a_file_that_is_no_model_is_refused(tmp_path, content):
    refusal(tmp_path, content)


@pytest.mark.parametrize(("name", "reason"), [("", "is no ONNX file"), ("missing.onnx", "No such file")])
def test_a_path_that_is_no_file_is_refused(tmp_path, name, reason):
    with pytest.raises(RefusedError, match=reason):
        Generator.open(file=tmp_path / name)


def test_the_rate_is_read_from_the_graph_where_the_metadata_lacks_it(tmp_path):
    path = tmp_path / "model.onnx"
    path.write_bytes(with_metadata(bake(tiny_family(), 13.7), {"rate_hz_per_m2": None}))
    model = Generator.open(file=path).model
    assert (model.rate_hz_per_m2, model.rate_uncertainty_hz_per_m2) == (82.6, 0.165)


def test_a_rate_that_is_not_that_of_the_metadata_is_refused(tmp_path):
    content = with_metadata(bake(tiny_family(), 13.7), {"rate_hz_per_m2": "82.7"})
    assert "its rate is 82.6, and 82.7 in its metadata" in refusal(tmp_path, content)


@pytest.mark.parametrize(("kind", "shape"), [("DOUBLE", [1]), ("FLOAT", [2]), ("FLOAT", [])])
def test_a_rate_of_another_type_or_shape_is_refused(tmp_path, kind, shape):
    model = onnx.load_from_string(bake(tiny_family(), 13.7))
    (rate,) = (output for output in model.graph.output if output.name == "rate_hz_per_m2")
    (stored,) = (tensor for tensor in model.graph.initializer if tensor.name == "rate_hz_per_m2/baked")
    value = np.full(shape, 82.6, np.float64 if kind == "DOUBLE" else np.float32)
    stored.CopyFrom(numpy_helper.from_array(value, stored.name))
    rate.CopyFrom(helper.make_tensor_value_info(rate.name, getattr(TensorProto, kind), shape))
    assert "its output rate_hz_per_m2 is tensor" in refusal(tmp_path, model.SerializeToString())


@pytest.mark.parametrize("version", ["1", "2"])
def test_a_model_without_the_rates_output_is_read_in_either_version(tmp_path, version):
    path = tmp_path / "model.onnx"
    path.write_bytes(tiny_model(metadata={"contract_version": version}))
    assert Generator.open(file=path).model.rate_hz_per_m2 == 55.5
