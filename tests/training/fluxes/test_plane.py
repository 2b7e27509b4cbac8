from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import dblquad

from deepmuon_runtime.errors import FailedError
from deepmuon_training.fluxes.ecomug import ecomug
from deepmuon_training.fluxes.flux import Flux
from deepmuon_training.fluxes.gccly import gccly
from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.plane import PRECISION, plane_rate


@pytest.mark.parametrize("flux", [MEASURED, gccly(), ecomug()], ids=lambda flux: flux.name)
@pytest.mark.parametrize(("low", "high"), [(1e-3, 0.1), (0.1, 60.0), (70.0, 1e5)])
def test_the_rate_is_the_integral_of_the_intensity_times_the_cosine(flux, low, high):
    def density(log_energy, cosine):
        energy = np.array(np.exp(log_energy))
        return 2 * np.pi * float(np.add(*flux.intensity(energy, np.array(cosine)))) * cosine * float(energy)

    # EcoMug's exponent bends at 67 GeV, which is in none of these ranges.
    parts = [dblquad(density, *ends, np.log(low), np.log(high)) for ends in ((0, 0.1), (0.1, 1))]
    assert plane_rate(flux, low, high) == pytest.approx(sum(part for part, _ in parts), rel=3 * PRECISION)


def test_the_rate_of_a_power_law_is_known():
    flux = Flux("power", "", lambda energy, cosine: (3 * energy**-2 * cosine, energy**-2 * cosine**1))
    assert plane_rate(flux, 1.0, 10.0) == pytest.approx(2 * np.pi / 3 * 4 * 0.9, rel=1e-9)


def test_a_flux_too_rough_to_be_integrated_is_told():
    def noise(energy, cosine):
        plus = 1 + np.modf(np.abs(np.sin(1e9 * energy * (1 + cosine))) * 1e5)[0] * (energy > 0)
        return plus, plus * 0

    with pytest.raises(FailedError, match="the rate of the flux noise can't be told"):
        plane_rate(Flux("noise", "", noise), 1.0, 10.0)
