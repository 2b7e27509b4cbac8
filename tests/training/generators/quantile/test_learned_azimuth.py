from __future__ import annotations

from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch

from deepmuon_runtime import Generator
from deepmuon_runtime.errors import RefusedError
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import FittedGenerator, export_fitted
from deepmuon_training.generators.quantile.azimuth_fit import AZIMUTH_BINS
from deepmuon_training.generators.quantile.azimuth_table import LEVEL_KNOTS, TAIL_KNOTS, azimuth_turn
from deepmuon_training.generators.quantile.circular_density import CircularDensity
from deepmuon_training.generators.quantile.fit import QuantileSettings
from deepmuon_training.generators.quantile.tables import tabulate
from deepmuon_training.generators.transformer.network import LATENTS
from deepmuon_training.learning.descent import Schedule
from deepmuon_training.sample import Sample
from deepmuon_training.scores.azimuth import compare_azimuth
from studies.pictures.mountain import behind_mountain

TRAINED, COMPARED = 300_000, 400_000
SETTINGS = QuantileSettings(azimuth=Schedule(steps=500, learning_rate=0.01, averaging=0.98, validate_every=100))


@pytest.fixture(scope="module")
def fitted(truth) -> FittedGenerator:
    sample = Sample(behind_mountain(truth(TRAINED, 5)), depth_m=0.0, source="behind a made-up mountain")
    return fit_generator(sample, "quantile", seed=1, settings=SETTINGS, azimuth="learned", progress=False)


@pytest.fixture(scope="module")
def model(fitted, tmp_path_factory):
    path = tmp_path_factory.mktemp("mountain") / "model.onnx"
    export_fitted(fitted, path)
    return path


@pytest.fixture(scope="module")
def generated(model):
    return Generator.open(file=model, device="cpu", threads=1).sample(COMPARED, seed=1)


@pytest.fixture(scope="module")
def held_out(truth):
    return behind_mountain(truth(COMPARED, 6))


def test_a_uniform_azimuth_is_refused_behind_a_mountain(held_out, sample):
    with pytest.raises(RefusedError, match="the azimuth is not uniform"):
        fit_generator(replace(sample, muons=held_out), "quantile", seed=1, settings=SETTINGS, progress=False)


def test_learned_azimuths_are_those_of_the_truth(generated, held_out):
    score = compare_azimuth(generated, held_out)
    # The training muons have noise of their own, as much again as the other two together, and more.
    noise = (1 / TRAINED + 1 / len(generated) + 1 / len(held_out)) / (1 / len(generated) + 1 / len(held_out))
    assert score.chi_square.ndf == 24
    assert score.chi_square.chi2 / noise < 24 + 5 * np.sqrt(48)  # of noise alone: 2e-5; the rest is for the short fit
    first = score.harmonics["1 to 10 GeV"][0]
    assert first.held_out > 0.1


@pytest.mark.parametrize(("low", "high"), [(0.001, 3.0), (3.0, 30.0), (30.0, 1e5)])
@pytest.mark.parametrize(("grazing", "steep"), [(0.0, 0.6), (0.6, 1.0)])
def test_the_shadow_is_as_deep_as_the_true_one_at_any_energy_and_zenith(generated, held_out, low, high, grazing, steep):
    def shadowed(muons):
        inside = (muons.kinetic_energy >= low) & (muons.kinetic_energy < high)
        inside &= (muons.cos_zenith >= grazing) & (muons.cos_zenith < steep)
        from_north = np.abs(np.arctan2(-muons.u[inside], -muons.v[inside]))
        return np.sum(from_north < np.radians(20)), np.sum(inside)

    (found, n), (expected, m) = shadowed(generated), shadowed(held_out)
    share = expected / m
    error = np.sqrt(share * (1 / n + 1 / m + COMPARED / TRAINED / m))  # of the training muons too
    assert abs(found / n - share) < 4 * error + 0.05 * share  # 4 sigma: 6e-5; 5 % for the short fit
    assert share < 0.9 * 40 / 360


def test_the_distribution_joins_smoothly_where_the_circle_closes(fitted):
    with torch.no_grad():
        y = torch.from_numpy(fitted.networks.y(np.linspace(-4, 4, 9))).float()
        log_density = fitted.networks.azimuth(y, torch.full_like(y, 0.5))
    step = log_density.diff(dim=1, append=log_density[:, :1]).abs()
    seam, elsewhere = step[:, -1], step[:, :-1].max(dim=1).values
    assert (seam <= elsewhere).all()
    assert (elsewhere > 0.1).all()


def test_the_map_of_latent_to_azimuth_is_monotone_and_goes_once_around(fitted, model):
    table = torch.from_numpy(tabulate(fitted.networks).azimuth).double()
    assert table.shape == (len(TAIL_KNOTS), len(LEVEL_KNOTS), AZIMUTH_BINS + 1)
    latent = torch.linspace(-1 + 2**-24, 1 - 2**-24, 20_001, dtype=torch.float64)
    for t, level in ((0.0, 0.0), (3.3, -4.1), (-12.0, 9.0)):
        turn = azimuth_turn(table, torch.full_like(latent, t), torch.full_like(latent, level), latent)
        assert (turn.diff() > 0).all()
        assert turn[0] == pytest.approx(-1, abs=1e-4)
        assert turn[-1] == pytest.approx(1, abs=1e-4)


def test_the_file_is_small_and_takes_as_many_latents_as_without(model):
    assert model.stat().st_size < 1_000_000
    proto = onnx.load(model)
    assert {p.key: p.value for p in proto.metadata_props}["deepmuon.latent_size"] == "5"
    assert "deepmuon.rate_hz_per_m2" not in {p.key for p in proto.metadata_props}


def test_a_generator_with_a_learned_azimuth_is_saved_and_loaded(fitted, model, tmp_path):
    fitted.save(tmp_path / "generator.pt")
    export_fitted(FittedGenerator.load(tmp_path / "generator.pt"), tmp_path / "again.onnx")
    assert (tmp_path / "again.onnx").read_bytes() == model.read_bytes()
    assert any("azimuth is learned" in note for note in fitted.notes)


def test_an_untrained_density_is_uniform():
    torch.manual_seed(1)
    density = CircularDensity(conditions=2, hidden=8, harmonics=4, bins=32)
    cumulative = density.cumulative(torch.randn(5, 2))
    torch.testing.assert_close(cumulative, torch.linspace(0, 1, 33).expand(5, -1))


def test_a_transformer_keeps_the_azimuth_of_its_network(transformer_model):
    """Its table of zenith angles changes the radius of (cos x, cos y) alone: it learns any azimuth."""
    latent = 2 * torch.rand(2000, transformer_model.latent_size, generator=torch.Generator().manual_seed(1)) - 1
    d = transformer_model.muons_per_draw
    latent[:, LATENTS + d :] = torch.linspace(1, -1, d)  # sort keys that leave the order as it is
    with torch.no_grad():
        _, direction, _ = transformer_model(latent)
        raw = transformer_model.network(latent[:, :LATENTS]).tanh()
    expected = torch.atan2(raw[:, 2], raw[:, 1]).flatten()
    found = torch.atan2(direction[:, 1], direction[:, 0])
    torch.testing.assert_close(found, expected, atol=1e-4, rtol=0)
