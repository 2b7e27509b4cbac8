from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.ball import Ball

from deepmuon_runtime import Box, Cylinder, Plane, RefusedError, Sphere, Target
from deepmuon_runtime.targets.by_name import target_of

SIZE = st.floats(0.01, 1000)
BODIES = st.one_of(st.builds(Sphere, SIZE), st.builds(Box, SIZE, SIZE, SIZE), st.builds(Cylinder, SIZE, SIZE))
TARGETS = st.one_of(BODIES, st.builds(Plane, SIZE, SIZE))


def directions(n: int, seed: int = 1) -> list[np.ndarray]:
    """Muons from the upper half of the sky, alike from everywhere."""
    random = np.random.default_rng(seed)
    c, phi = random.uniform(0.001, 1, n), random.uniform(-np.pi, np.pi, n)
    s = np.sqrt(1 - c * c)
    return [column.astype(np.float32) for column in (s * np.cos(phi), s * np.sin(phi), -c)]


def numbers(n: int, seed: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (n, 3)).astype(np.float32)


@settings(deadline=None)
@given(target=TARGETS, seed=st.integers(0, 1000))
def test_muons_that_hit_a_target_enter_it_on_its_surface(target: Target, seed: int):
    u, v, w = directions(2000, seed)
    hits, *place = target.enters(u, v, w, numbers(2000, seed))
    assert target.touches(*(part[hits] for part in (*place, u, v, w))).all()


@settings(deadline=None)
@given(target=BODIES)
def test_no_shadow_is_larger_than_the_largest_area(target: Target):
    area = target.projected_area(*(part.astype(float) for part in directions(2000)))
    assert (area > 0).all()
    assert area.max() <= target.largest_area * (1 + 1e-6)  # of directions in float32


@settings(deadline=None, max_examples=30)
@given(target=BODIES, seed=st.integers(0, 2**32))
def test_muons_hit_a_body_as_often_as_its_shadow_is_large(target: Target, seed: int):
    """At 6 standard deviations: 2e-9 false alarms for each."""
    n = 20_000
    u, v, w = directions(n, seed)
    chance = target.projected_area(u, v, w).astype(float) / target.largest_area
    hits = target.enters(u, v, w, numbers(n, seed + 1)).hits
    assert abs(hits.sum() - chance.sum()) <= 6 * np.sqrt((chance * (1 - chance)).sum()) + 1e-3


@pytest.mark.parametrize("target", [Sphere(2.0), Box(4, 3, 2), Cylinder(1, 3)], ids=str)
def test_muons_lie_on_the_shadow_uniformly(target: Target):
    """Mean and covariance of places along two axes across one direction, against those of a fine grid of lines.

    At 5 standard deviations, 5 numbers each: 3e-6 false alarms.
    """
    n = 200_000
    d = np.float32([0.48, 0.36, -0.8])
    u, v, w = (np.full(n, x, np.float32) for x in d)
    hits, *place = target.enters(u, v, w, numbers(n))
    e1 = np.array([0.6, -0.8, 0.0])
    e2 = np.cross(d, e1)
    found = np.stack([np.stack(place, 1)[hits] @ e for e in (e1, e2)])
    side = np.linspace(-4, 4, 241)
    a, b = np.meshgrid(side, side)
    lines = a.ravel()[:, None] * e1 + b.ravel()[:, None] * e2
    is_met = meets(target, lines, d.astype(float))
    grid = np.stack([a.ravel()[is_met], b.ravel()[is_met]])
    pairs = [(found[0], grid[0]), (found[1], grid[1])]
    pairs += [(found[i] * found[j], grid[i] * grid[j]) for i, j in ((0, 0), (0, 1), (1, 1))]
    for one, other in pairs:
        assert abs(one.mean() - other.mean()) < 5 * other.std() / math.sqrt(len(one)) + 1e-2


def meets(target: Target, lines: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Which lines meet a body, by trying many points of each."""
    found = np.zeros(len(lines), bool)
    for step in np.linspace(-4, 4, 321):
        x, y, z = (lines + step * d).T
        if isinstance(target, Sphere):
            found |= x**2 + y**2 + z**2 <= target.radius**2
        elif isinstance(target, Box):
            found |= (abs(x) <= target.x / 2) & (abs(y) <= target.y / 2) & (abs(z) <= target.z / 2)
        elif isinstance(target, Cylinder):
            found |= (x**2 + y**2 <= target.radius**2) & (abs(z) <= target.height / 2)
    return found


def test_a_body_of_ones_own_is_hit_as_the_same_one_of_deepmuons():
    """At 5 standard deviations: 6e-7 false alarms."""
    own, sphere, n = Ball(1.0, 1.5), Sphere(1.0), 100_000
    u, v, w = directions(n)
    hits, *place = own.enters(u, v, w, numbers(n))
    assert sphere.touches(*(part[hits] for part in (*place, u, v, w))).all()
    expected = sphere.largest_area / own.largest_area
    assert abs(hits.mean() - expected) < 5 * math.sqrt(expected * (1 - expected) / n)
    some = [part[:10] for part in (u, v, w)]
    np.testing.assert_allclose(own.projected_area(*some), sphere.largest_area, rtol=0.01)
    assert (own.name, own.size) == ("Ball", (1.5,))


@given(st.integers(0, 2**32))
def test_a_body_may_fill_the_sphere_around_it_and_not_reach_out_of_it(seed: int):
    u, v, w = directions(10_000, seed)
    assert Ball(1.0, 1.0).enters(u, v, w, numbers(10_000, seed + 1)).hits.mean() > 0.99
    with pytest.raises(RefusedError, match=r"the Ball reaches .* m out of the sphere of 0\.9 m that should hold"):
        Ball(1.0, 0.9).enters(u, v, w, numbers(10_000, seed + 1))


@pytest.mark.parametrize("size", [0, -1, math.nan, math.inf, "2", True, None, 1e9])
@pytest.mark.parametrize("make", [Sphere, lambda x: Box(1, x, 1), lambda x: Cylinder(1, x), lambda x: Plane(x, 1)])
def test_a_size_that_is_none_is_refused(make, size):
    with pytest.raises(RefusedError, match="and should be"):
        make(size)


@given(target=TARGETS)
def test_a_target_is_found_again_by_its_name_and_size(target: Target):
    assert target_of(target.name, target.size) == target


def test_a_target_of_another_name_is_none_of_deepmuons():
    assert target_of("Ball", [1.5]) is None
    with pytest.raises(RefusedError, match="a box has 3 sizes, and 2 are given"):
        target_of("box", [1, 2])
