from __future__ import annotations

import copy
from itertools import pairwise

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp

from deepmuon_training.generators.transformer.model import ChargeTable, radius_table, raw_muons
from deepmuon_training.generators.transformer.network import LATENTS


def latents(model, draws: int, seed: int, dtype: torch.dtype = torch.float32) -> torch.Tensor:
    random = torch.Generator().manual_seed(seed)
    return 2 * torch.rand(draws, model.latent_size, generator=random, dtype=dtype) - 1


@pytest.fixture(scope="module")
def generated(transformer_model):
    with torch.no_grad():
        return transformer_model(latents(transformer_model, 20_000, seed=1))


def test_a_draw_needs_100_latents_and_two_for_each_muon(transformer_model):
    assert transformer_model.muons_per_draw == 16
    assert transformer_model.latent_size == 100 + 2 * 16


def test_the_stored_weights_are_float16_numbers(transformer, transformer_model):
    for stored, trained in zip(transformer_model.network.parameters(), transformer.parameters(), strict=True):
        assert torch.equal(stored, stored.half().float())
        torch.testing.assert_close(stored, trained, rtol=2**-11, atol=2**-25)


def test_the_radius_table_rises_from_the_vertical_to_just_above_the_horizon(transformer_model):
    angle = transformer_model.angle
    assert angle[0] == 0
    assert np.all(np.diff(angle) >= 0)
    assert angle[-1] == np.float32(np.pi / 2 - 1e-4)


def test_the_radius_table_gives_the_generated_muons_the_samples_zenith_angles(transformer, transformer_model, sample):
    radius = raw_muons(transformer, 500_000, seed=9)[:, 1:].norm(dim=1).numpy()  # others than the table was made of
    angle = np.interp(radius, np.linspace(0, 1.4375, 1473), transformer_model.angle)
    mended = ks_2samp(np.cos(angle), sample.muons.cos_zenith).statistic
    bare = ks_2samp(np.sqrt(np.maximum(0, 1 - radius**2)), sample.muons.cos_zenith).statistic
    assert mended < 0.008 < bare  # two alike samples show 0.003 on average


def test_the_table_of_a_sample_is_the_same_again(transformer, sample):
    first, again = (radius_table(transformer, sample.muons, seed=3, generated=1000) for _ in range(2))
    np.testing.assert_array_equal(first, again)


def test_no_muon_goes_up_though_the_bare_network_makes_some(transformer, generated):
    assert torch.any(raw_muons(transformer, 320_000, seed=1)[:, 1:].norm(dim=1) > 1)
    assert torch.all(generated[1][:, 2] < 0)


def test_directions_have_unit_length(generated):
    direction = generated[1].double()
    assert torch.all((direction.norm(dim=1) - 1).abs() < 1e-6)


def test_the_mended_directions_keep_their_azimuth(transformer_model):
    latent = latents(transformer_model, 100, seed=2, dtype=torch.float64)
    with torch.no_grad():
        _, direction, _ = transformer_model(latent)
        keys = latent[:, LATENTS + 16 :]
        rows = copy.deepcopy(transformer_model.network).double()(latent[:, :LATENTS])
    order = keys.argsort(dim=1, descending=True)
    x, y = (torch.tanh(rows[:, k].gather(1, order)).flatten() for k in (1, 2))
    torch.testing.assert_close(torch.atan2(direction[:, 1], direction[:, 0]), torch.atan2(y, x))


def test_energies_are_within_their_range(transformer_model, generated):
    low, high = (torch.tensor(end, dtype=torch.float32) for end in transformer_model.energy_range)
    assert torch.all((generated[0] >= low) & (generated[0] <= high))


def test_sort_keys_shuffle_the_muons_of_a_draw(transformer_model):
    latent = latents(transformer_model, 50, seed=3)
    other = latent.clone()
    other[:, LATENTS + 16 :] = latents(transformer_model, 50, seed=4)[:, LATENTS + 16 :]
    with torch.no_grad():
        muons, shuffled = (
            torch.cat([energy[:, None], direction], dim=1).reshape(50, 16, 4)
            for energy, direction, _ in (transformer_model(latent), transformer_model(other))
        )
    assert not torch.equal(muons, shuffled)
    for draw, shuffled_draw in zip(muons, shuffled, strict=True):
        assert sorted(draw.tolist()) == sorted(shuffled_draw.tolist())


def test_every_position_gives_the_same_distribution(generated):
    # The bare network's positions differ, with KS distances of 0.16 and more.
    energy = generated[0].reshape(-1, 16)
    everything = energy.flatten().numpy()
    for position in energy.T:
        assert (
            ks_2samp(position.numpy(), everything).statistic < 0.02
        )  # 20,000: noise 0.006, 1.95 times it once in 1000


def test_equal_keys_leave_the_order_as_it_is(transformer_model):
    latent = latents(transformer_model, 4, seed=5)
    latent[:, LATENTS + 16 :] = 0.25
    other = latent.clone()
    other[:, LATENTS + 16 :] = torch.linspace(0.9, -0.9, 16)  # the largest key comes first
    with torch.no_grad():
        assert torch.equal(transformer_model(latent)[0], transformer_model(other)[0])


def test_charges_follow_the_probability_at_their_energy_and_zenith(generated, charge_truth):
    energy, direction, found = (part.double().numpy() for part in generated)
    expected = charge_truth(energy, -direction[:, 2])
    edges = np.quantile(energy, np.linspace(0, 1, 11))
    for low, high in pairwise(edges):
        inside = (energy >= low) & (energy <= high)
        # 32,000 muons: 0.0028 of noise, and as much from training on 100,000
        assert abs(np.mean(found[inside] > 0) - np.mean(expected[inside])) < 0.02
    assert np.mean(found[energy > 20] > 0) - np.mean(found[energy < 0.5] > 0) > 0.1


@given(x=st.floats(-10, 20), cos_zenith=st.floats(0, 1))
@settings(max_examples=50)
def test_the_charge_table_is_its_network(charge, transform, transformer_model, x, cos_zenith):
    """Beyond the table's ends the outermost rows hold, as the network's condition does."""
    y = torch.tensor([x - transform.mean], dtype=torch.float64)
    c = torch.tensor([cos_zenith], dtype=torch.float64)
    with torch.no_grad():
        expected = torch.tanh(charge(y.float(), c.float()) / 2).double()
    found = transformer_model._threshold(torch.tensor([x], dtype=torch.float64), c)
    torch.testing.assert_close(found, expected, rtol=0, atol=2e-3)


def test_the_charge_table_is_a_probability(charge, transform):
    table = ChargeTable.of(charge, transform)
    assert table.values.shape == (129, 17)
    assert np.all(np.abs(table.values) < 1)
    assert table.x_range == pytest.approx(
        (charge.condition.low + transform.mean, charge.condition.high + transform.mean)
    )
