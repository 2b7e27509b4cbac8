from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_training.fluxes.gccly import gccly, production_cosine

MASS = 0.1056583755


def published(kinetic_energy: float, cosine: float) -> float:
    """Both charges per m2, s, sr and GeV, as arXiv:1509.06176 prints it per cm2."""
    energy = kinetic_energy + MASS
    square = cosine**2 + 0.102573**2 - 0.068287 * cosine**0.958633 + 0.0407253 * cosine**0.817285
    star = (square / (1 + 0.102573**2 - 0.068287 + 0.0407253)) ** 0.5
    pions, kaons = 1 / (1 + 1.1 * energy * star / 115), 0.054 / (1 + 1.1 * energy * star / 850)
    return 1e4 * 0.14 * (energy * (1 + 3.64 / (energy * star**1.29))) ** -2.7 * (pions + kaons)


@given(st.floats(1e-3, 1e6), st.floats(0, 1), st.floats(0.5, 2))
def test_the_flux_is_the_published_formula_and_its_charges_have_the_ratio_asked_for(energy, cosine, ratio):
    plus, minus = gccly(ratio).intensity(np.array(energy), np.array(cosine))
    assert plus + minus == pytest.approx(published(energy, cosine), rel=1e-12)
    assert plus / minus == pytest.approx(ratio, rel=1e-12)


def test_a_horizontal_muon_was_born_at_another_angle_and_a_vertical_one_was_not():
    np.testing.assert_allclose(production_cosine(np.array([0.0, 1.0])), [0.1035, 1.0], rtol=1e-3)
