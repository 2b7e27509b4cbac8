from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit

from deepmuon_training.families.sphere import TriangularMap, through_sphere

T = np.linspace(-34, 34, 2177)
ROW_T = np.linspace(-10, 10, 65)
COLUMN = np.linspace(-17.5, 17.5, 129)


def plane(cosine: object, charge: object = lambda level: 0 * level) -> TriangularMap:
    """A map of cos zenith given its level, the same at all energies, whose logarithm is t / 2."""
    level = np.tile(COLUMN, (len(ROW_T), 1))
    return TriangularMap(
        t=T,
        energy=T / 2,
        row=np.interp(T, ROW_T, np.arange(len(ROW_T))),
        row_t=ROW_T,
        column=COLUMN,
        zenith=cosine(level),
        charge=charge(level),
        least_cosine=2.0**-20,
    )


@pytest.mark.parametrize("power", [1, 2, 3])
def test_the_sphere_of_a_power_of_cos_zenith_has_a_power_less(power):
    """J = cos^n zenith: the level is cos^(n + 2) in a plane, cos^(n + 1) in a sphere, of (n + 2) / (n + 1) the rate."""

    def logit_of_power(level: np.ndarray, exponent: float) -> np.ndarray:
        """Of level^exponent, for logits of the level, with all digits at both ends."""
        logarithm = -exponent * np.logaddexp(0, -level)
        return logarithm - np.log(-np.expm1(logarithm))

    energy, zenith, _, mean = through_sphere(plane(lambda level: logit_of_power(level, 1 / (power + 2))))
    assert mean == pytest.approx((power + 2) / (power + 1), rel=1e-4)
    right = np.tile(logit_of_power(COLUMN, 1 / (power + 1)), (len(ROW_T), 1))
    inside = np.abs(COLUMN) < 14
    np.testing.assert_allclose(expit(zenith[:, inside]), expit(right[:, inside]), rtol=3e-3)
    np.testing.assert_allclose(energy, T / 2, atol=1e-6)


def test_charges_stay_with_their_muons():
    turned = plane(lambda level: level / 4 + 1, lambda level: np.tanh(level / 4 + 1))
    _, zenith, charge, _ = through_sphere(turned)
    inside = np.abs(COLUMN) < 14
    np.testing.assert_allclose(np.arctanh(charge[:, inside]), zenith[:, inside], atol=0.02)


def test_where_flat_muons_have_less_energy_so_have_the_spheres():
    flat = TriangularMap(**{**vars(plane(lambda level: level / 3)), "zenith": COLUMN / 3 + ROW_T[:, None] / 10})
    energy, _, _, mean = through_sphere(flat)
    inside = np.abs(T) < 8
    assert np.all(energy[inside] < T[inside] / 2)
    assert np.all(np.diff(energy) >= 0)
    assert mean > 1


def test_near_the_horizon_the_spheres_map_is_a_power_less():
    """cos zenith ~ level^a in a plane is level^(a / (1 - a)) in a sphere, beyond all columns, too."""
    power = 0.4
    _, zenith, _, mean = through_sphere(plane(lambda level: power * level))
    slope = np.diff(zenith[:, :20]) / np.diff(COLUMN[:20])
    np.testing.assert_allclose(slope, power / (1 - power), rtol=0.01)  # there is an end at 2^-20
    assert mean > 1 / (1 - power)
