from __future__ import annotations

import numpy as np
import pytest

from deepmuon_training.fluxes.energy_loss import ionisation_loss


@pytest.mark.parametrize(("kinetic_energy", "loss"), [(0.01, 7.039e-3), (0.258, 1.815e-3)])
def test_the_loss_in_air_is_that_of_the_review_of_particle_physics(kinetic_energy, loss):
    assert ionisation_loss(np.array(kinetic_energy)) == pytest.approx(loss, rel=1e-3)


def test_a_muon_loses_least_near_a_quarter_of_a_gev():
    energy = np.geomspace(1e-3, 1e6, 10_000)
    assert 0.2 < energy[ionisation_loss(energy).argmin()] < 0.3
