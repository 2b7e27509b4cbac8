"""The models that come with the package."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import onnx
import pytest

from deepmuon_runtime import Generator, Model, list_models
from deepmuon_runtime.model.released import default_architecture, read_released

ARCHITECTURES = ("quantile", "transformer")
DEPTHS = (0, 10, 20, 30, 40, 50)
MEDIAN_ENERGIES = dict(zip(DEPTHS, (2.815, 3.141, 4.184, 5.279, 6.369, 7.446), strict=True))
"""In GeV, of the six million and more muons that were carried to each depth."""
POSITIVE = dict(zip(DEPTHS, (0.518, 0.502, 0.495, 0.491, 0.488, 0.485), strict=True))
"""Their fraction of mu+: CRY's tables have more mu- at high energies."""
LARGEST_FILE, LARGEST_FAMILY = 1_000_000, 4_000_000  # bytes


FIXED = [model for model in list_models() if not model.is_family]


@pytest.fixture(params=list_models(), ids=lambda model: model.name)
def model(request: pytest.FixtureRequest) -> Model:
    return request.param


def test_both_architectures_come_for_every_depth():
    expected = {(architecture, depth) for architecture in ARCHITECTURES for depth in DEPTHS}
    assert {(model.architecture, model.depth_m) for model in FIXED} == expected
    assert default_architecture() in ARCHITECTURES


def test_a_file_is_what_the_oldest_onnx_runtime_reads(model: Model):
    content = read_released(model)
    assert len(content) <= (LARGEST_FAMILY if model.is_family else LARGEST_FILE)
    loaded = onnx.load_from_string(content)
    onnx.checker.check_model(loaded, full_check=True)
    assert loaded.ir_version <= 9
    assert [(opset.domain, opset.version <= 20) for opset in loaded.opset_import] == [("", True)]
    assert {node.domain for node in loaded.graph.node} == {""}
    assert not [node.op_type for node in loaded.graph.node if node.op_type.startswith("Random")]
    assert all(tensor.data_location != onnx.TensorProto.EXTERNAL for tensor in loaded.graph.initializer)


def test_a_model_says_what_it_was_trained_on(model: Model):
    keys = {"training_source", "training_muons", "training_seed"}
    if model.flux == "cry":  # whose tables have steps
        keys |= {"training_smoothed"}
    if not (model.is_family or "baked_from" in model.metadata):  # whose knots have a transform each
        keys |= {"boxcox_lambda", "energy_mean"}
    assert keys <= model.metadata.keys()


def test_what_is_baked_is_of_the_released_family():
    families = {model.sha256 for model in list_models() if model.is_family}
    assert {model.metadata["baked_from"] for model in FIXED if "baked_from" in model.metadata} <= families


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("depth", DEPTHS)
def test_a_model_knows_its_rate(architecture: str, depth: float):
    model = Generator.open(depth, architecture, device="cpu").model
    assert model.rate_hz_per_m2 is not None
    assert model.rate_uncertainty_hz_per_m2 is not None
    assert 0 < model.rate_uncertainty_hz_per_m2 < 0.01 * model.rate_hz_per_m2


def test_a_model_has_its_card(model: Model):
    card = files("deepmuon_models").joinpath(model.name.replace(".onnx", ".md")).read_text(encoding="utf-8")
    assert model.sha256 in card
    for heading in ("\n## What made it\n", "\n## Scores\n", "\n## Limits\n"):
        assert heading in card


@pytest.mark.parametrize("fixed", FIXED, ids=lambda model: model.name)
def test_a_model_gives_the_energies_directions_and_charges_of_its_depth(fixed: Model):
    file = files("deepmuon_models").joinpath(fixed.name)
    muons = Generator.open(file=str(file), device="cpu").sample(200_000, seed=1)
    # The scores on the cards are the real judgement, this sees an exchange of files.
    assert np.median(muons.kinetic_energy) == pytest.approx(MEDIAN_ENERGIES[fixed.depth_m], rel=0.03)
    assert np.mean(muons.charge > 0) == pytest.approx(POSITIVE[fixed.depth_m], abs=0.01)
    assert muons.cos_zenith.mean(dtype=np.float64) == pytest.approx(0.80, abs=0.01)
    assert muons.u.mean(dtype=np.float64) == pytest.approx(0, abs=0.02)
    assert muons.v.mean(dtype=np.float64) == pytest.approx(0, abs=0.02)
    by_depth = Generator.open(fixed.depth_m, fixed.architecture, device="cpu").sample(1000, seed=1)
    assert np.array_equal(by_depth.kinetic_energy, muons.kinetic_energy[:1000])


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_the_rate_falls_with_depth_as_the_surviving_fraction(architecture: str):
    rates = [Generator.open(depth, architecture, device="cpu").model.rate_hz_per_m2 for depth in DEPTHS]
    # Of CRY's muons, six million and more of which were carried to each depth.
    assert np.divide(rates, rates[0]) == pytest.approx([1, 0.5042, 0.2692, 0.1641, 0.1095, 0.0776], rel=0.005)


@pytest.mark.parametrize(
    ("depth", "rate", "median", "positive"),
    # Of muons that trained nothing, 4,146,596 at 2 m and 4,119,881 at 14 m; and of the deepest knot's 4,110,942.
    [(2, 99.835, 2.6656, 0.5155), (14, 42.627, 3.5419, 0.4987), (100, 2.5303, 12.751, 0.4788)],
)
def test_the_family_has_the_muons_of_depths_between_and_beyond_the_baked_ones(depth, rate, median, positive):
    """Rate, median and charge within 0.5 %, and 4 standard deviations: there is one false alarm in 2600 seeds."""
    n = 1_000_000
    generator = Generator.open(depth, device="cpu")
    muons = generator.sample(n, seed=1)
    assert generator.model.is_family
    assert generator.model.rate_hz_per_m2 == pytest.approx(rate, rel=0.005)
    below = np.mean(muons.kinetic_energy < median)
    assert below == pytest.approx(0.5, abs=0.0025 + 4 * 0.5 / np.sqrt(n))
    assert np.mean(muons.charge > 0) == pytest.approx(positive, abs=0.0025 + 4 * 0.5 / np.sqrt(n))


def test_any_two_models_of_a_seed_have_nothing_in_common():
    """The correlation of log E is within 4 standard deviations: 66 pairs give one false alarm in 240 seeds."""
    n = 50_000
    energies = [
        Generator.open(model.depth_m, model.architecture, device="cpu").sample(n, seed=1).kinetic_energy
        for model in FIXED
    ]
    correlations = np.corrcoef(np.log(energies))[np.triu_indices(len(energies), 1)]
    assert len(correlations) == 66
    assert np.abs(correlations).max() < 4 / np.sqrt(n)
