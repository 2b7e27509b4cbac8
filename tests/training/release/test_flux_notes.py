from __future__ import annotations

import pytest

from deepmuon_training.release.flux_notes import flux_notes


@pytest.mark.parametrize(
    ("flux", "whose"), [("cry", "Lawrence Livermore National Laboratory"), ("measured", "BESS-TeV"), ("mine", "mine")]
)
def test_a_flux_is_credited_by_its_name(flux, whose):
    assert whose in flux_notes(flux).credit


@pytest.mark.parametrize("flux", ["cry", "measured"])
def test_a_known_flux_has_limits_of_its_own_beside_those_of_all(flux):
    assert set(flux_notes(flux).limits) > set(flux_notes(None).limits) == set(flux_notes("mine").limits)
