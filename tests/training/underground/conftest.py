"""Integrals that several tests look at, made once."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.underground.integration import Integral, plane_integral
from deepmuon_training.underground.overburden import overburden
from deepmuon_training.underground.place import Place, place
from deepmuon_training.underground.workers import Workers


@pytest.fixture(scope="session")
def workers() -> Iterator[Workers]:
    with Workers(overburden("water"), 1) as alone:
        yield alone


@pytest.fixture(scope="session")
def under_water() -> Callable[[float], Place]:
    """A depth under water and the measured flux."""
    return lambda depth: place(MEASURED, overburden("water"), depth)


@pytest.fixture(scope="session")
def kilometre(workers: Workers, under_water: Callable[[float], Place]) -> Integral:
    """The rate under 1000 m of water."""
    return plane_integral(under_water(1000), workers, seed=1)
