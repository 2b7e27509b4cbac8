"""Cuts, targets and times of a family whose distributions are known by formulas."""

from __future__ import annotations

import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.analytic_family import MEAN_COS, MEAN_SIN, PLANE_RATE, SPHERE_RATE, analytic_family
from support.ball import Ball
from support.tiny_models import tiny_model

from deepmuon_runtime import (
    Box,
    ConvexBody,
    Cuts,
    Cylinder,
    Generator,
    Muons,
    Plane,
    RefusedError,
    Shard,
    Sphere,
    Target,
    check_file,
    merge_shards,
    read_attributes,
    read_muons,
)

RESOLVED = 2e-4  # relative, of integrals
pytestmark = [
    pytest.mark.filterwarnings("ignore:the .* gets the muons of its centre"),
    pytest.mark.filterwarnings("ignore:the cuts keep 1 muon in"),
]


def opened(folder: Path, contents: bytes, **options: object) -> Generator:
    path = folder / "model.onnx"
    path.write_bytes(contents)
    return Generator.open(file=path, **options)


@pytest.fixture(scope="module")
def family(tmp_path_factory) -> Generator:
    return opened(tmp_path_factory.mktemp("family"), analytic_family())


@pytest.fixture(scope="module")
def rejecting(tmp_path_factory) -> Generator:
    """The same, but it does not say which latents make the energy."""
    return opened(tmp_path_factory.mktemp("family"), analytic_family({"energy_latents": None}))


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """The Kolmogorov-Smirnov distance in units of its scale: over 2.5 by chance once in 130,000 times."""
    both = np.concatenate([one, other])
    shares = [np.searchsorted(np.sort(part), both, side="right") / len(part) for part in (one, other)]
    return float(np.abs(shares[0] - shares[1]).max()) * math.sqrt(len(one) * len(other) / len(both))


def distance_to(one: np.ndarray, cumulative: np.ndarray) -> float:
    """The same between muons and the probabilities of at most each of them."""
    order = np.sort(cumulative)
    steps = np.arange(len(one) + 1) / len(one)
    return float(max(np.abs(order - steps[1:]).max(), np.abs(order - steps[:-1]).max())) * math.sqrt(len(one))


def are_equal(a: Muons, b: Muons) -> bool:
    return a.columns.keys() == b.columns.keys() and all(
        np.array_equal(column, b.columns[name]) for name, column in a.columns.items()
    )


# Mean projected areas by formula: of top and side, and of the plane's own flux.
AREAS = [
    (Sphere(2.0), SPHERE_RATE * math.pi * 4),
    (Box(4, 4, 3), SPHERE_RATE * (16 * MEAN_COS + 24 * MEAN_SIN * 2 / math.pi)),
    (Cylinder(1.5, 4), SPHERE_RATE * (2.25 * math.pi * MEAN_COS + 12 * MEAN_SIN)),
    (Plane(2, 3), PLANE_RATE * 6),
    (Box(2, 3, 1e-6), PLANE_RATE * 6),  # a flat box is the plane
    (Box(1e-6, 3, 4), SPHERE_RATE * 12 * MEAN_SIN * 2 / math.pi),  # a thin one a wall
    (Ball(1.0, 1.3), SPHERE_RATE * math.pi),
]


@pytest.mark.parametrize(("target", "expected"), AREAS, ids=str)
def test_the_rate_is_that_of_the_mean_shadow(family: Generator, target: Target, expected: float):
    rate = family.rate(target=target)
    assert rate is not None
    tolerance = 2e-3 if isinstance(target, ConvexBody) else RESOLVED
    assert rate.hz == pytest.approx(expected, rel=tolerance)
    assert rate.uncertainty == pytest.approx(0.002 * rate.hz, rel=0.1)


def test_without_a_target_the_rate_is_the_models(family: Generator):
    rate = family.rate()
    assert rate == (family.model.rate_hz_per_m2, family.model.rate_uncertainty_hz_per_m2)
    assert rate is not None
    assert rate.hz == pytest.approx(PLANE_RATE, rel=1e-4)


CUTS = [
    (Cuts(energy_min=3), 0.1),
    (Cuts(energy_max=0.5), 0.2),
    (Cuts(energy_min=1, energy_max=2), 0.5 - 0.2),
    (Cuts(energy_min=1000), 1 / (1 + 1e6)),
    (Cuts(zenith_max=60), 1 - 0.5**4),
    (Cuts(zenith_min=60), 0.5**4),
    (Cuts(zenith_min=30, zenith_max=60, energy_min=3), 0.1 * (0.75**2 - 0.5**4)),
    (Cuts(energy_min=1e-9), 1.0),
]


@pytest.mark.parametrize(("cuts", "expected"), CUTS, ids=str)
def test_cuts_keep_the_share_that_the_formulas_say(family: Generator, cuts: Cuts, expected: float):
    assert family.fraction_kept(cuts) == pytest.approx(expected, rel=5e-4)
    rate = family.rate(cuts=cuts)
    assert rate is not None
    assert rate.hz == pytest.approx(PLANE_RATE * expected, rel=5e-4)


@pytest.mark.parametrize(("cuts", "share"), CUTS[:7], ids=str)
def test_muons_within_cuts_have_the_distribution_that_is_left(family: Generator, cuts: Cuts, share: float):
    """By the Kolmogorov-Smirnov distances of energy, cos zenith and azimuth: 2e-5 false alarms each case."""
    n = 200_000
    muons = family.sample(n, seed=1, cuts=cuts)
    assert cuts.keeps(muons).all()
    least, most = 1e-8 if cuts.energy_min is None else cuts.energy_min, cuts.energy_max
    above = 1 / (1 + least**2)
    below = 0 if most is None else 1 / (1 + most**2)
    energy = muons.kinetic_energy.astype(float)
    assert distance_to(energy, (above - 1 / (1 + energy**2)) / (above - below)) < 2.5
    low = 0 if cuts.zenith_max is None else math.cos(math.radians(cuts.zenith_max))
    high = 1 if cuts.zenith_min is None else math.cos(math.radians(cuts.zenith_min))
    cosine = muons.cos_zenith.astype(float)
    assert distance_to(cosine, (cosine**4 - low**4) / (high**4 - low**4)) < 2.5
    assert distance_to(cosine, np.arctan2(muons.v, muons.u) / (2 * np.pi) + 0.5) < 2.5


def test_energies_cut_by_latents_are_fine_where_few_muons_are(family: Generator):
    """One muon in ten thousand million: two latents have some 30,000 levels there, one would have none."""
    cuts = Cuts(energy_min=1e5)
    with pytest.warns(UserWarning, match=r"the cuts keep 1 muon in 1e\+10$"):
        muons = family.sample(100_000, seed=1, cuts=cuts)
    assert len(np.unique(muons.kinetic_energy)) > 10_000
    assert muons.kinetic_energy.min() >= 1e5


@settings(deadline=None, max_examples=25)
@given(low=st.floats(1e-3, 1e3), factor=st.floats(1.0001, 1e3), seed=st.integers(0, 2**64 - 1))
def test_no_energy_leaves_its_bounds(family: Generator, low: float, factor: float, seed: int):
    muons = family.sample(20_000, seed, cuts=Cuts(energy_min=low, energy_max=low * factor))
    assert (muons.kinetic_energy.astype(float) >= low).all()
    assert (muons.kinetic_energy.astype(float) <= low * factor).all()


def test_rejecting_energies_gives_the_same_as_cutting_latents(family: Generator, rejecting: Generator):
    """By the distances of two samples: 1e-5 false alarms."""
    cuts = Cuts(energy_min=1, energy_max=5)
    one, other = (generator.sample(200_000, seed, cuts=cuts) for generator, seed in ((family, 1), (rejecting, 2)))
    for name in ("kinetic_energy", "u", "w"):
        assert distance(getattr(one, name), getattr(other, name)) < 2.5
    assert rejecting.fraction_kept(cuts) == pytest.approx(family.fraction_kept(cuts), rel=5e-4)


def test_cuts_of_draws_of_many_muons_are_exact_too(tmp_path: Path):
    """Kinetic energies of the tiny model are exp(3 l): of 1 to e^1.5 GeV, l is uniform. 1e-5 false alarms."""
    generator = opened(tmp_path, tiny_model(300))
    cuts = Cuts(energy_min=1, energy_max=math.exp(1.5))
    assert generator.fraction_kept(cuts) == pytest.approx(0.25, rel=0.02)
    muons = generator.sample(100_000, seed=1, cuts=cuts)
    assert distance_to(muons.kinetic_energy, np.log(muons.kinetic_energy.astype(float)) / 1.5) < 2.5
    assert are_equal(generator.sample(1000, seed=1, cuts=cuts), muons[:1000])


SELECTIONS = [
    {"cuts": Cuts(energy_min=3)},
    {"cuts": Cuts(zenith_min=70)},
    {"target": Box(4, 4, 3)},
    {"target": Plane(4, 4), "cuts": Cuts(zenith_max=30)},
    {"target": Sphere(1)},
    {"target": Cylinder(1, 5), "cuts": Cuts(energy_min=1, zenith_min=60)},
]


@pytest.mark.parametrize("chosen", SELECTIONS, ids=str)
def test_a_muon_is_the_same_for_any_number_part_and_threads(family: Generator, chosen: dict, tmp_path: Path):
    many = family.sample(200_001, seed=5, **chosen)
    assert are_equal(family.sample(1000, seed=5, **chosen), many[:1000])
    assert are_equal(family.sample(999, seed=5, first=150_001, **chosen), many[150_001:151_000])
    other = opened(tmp_path, analytic_family(), threads=3)
    assert are_equal(Muons.concatenate(list(other.chunks(200_001, seed=5, **chosen))), many)


@pytest.mark.parametrize(
    "body",
    [Box(2, 3, 1.5), Cylinder(1, 2), Sphere(1.2)],
    ids=str,
)
def test_a_body_is_hit_as_from_a_plane_above_it(family: Generator, body: Target):
    """Up to 45 degrees, where none comes past the plane; a million muons in the box.

    By the distances of all columns, 1e-5 false alarms each, and by the number at 5 standard deviations.
    """
    cuts = Cuts(zenith_max=45)
    half = body.vertical_size / 2
    side = 2 * (max(body.size) + 2 * half)
    plane, rate = Plane(side, side), family.rate(target=body, cuts=cuts)
    columns: list[np.ndarray] = []
    tried = 0
    number = int((1e6 if isinstance(body, Box) else 2e5) * side**2 / 8)
    for muons in family.chunks(number, seed=1, target=plane, cuts=cuts):
        assert muons.x is not None
        assert muons.y is not None
        tried += len(muons)
        d = np.stack([muons.u, muons.v, muons.w]).astype(float)
        start = np.stack([muons.x, muons.y, np.full(len(muons), half, np.float32)]).astype(float)
        path = first_met(body, start, d)
        met = np.isfinite(path)
        columns.append(np.stack([muons.kinetic_energy, *d, *(start + path * d)])[:, met])
    brute = np.concatenate(columns, axis=1)
    direct = family.sample(brute.shape[1], seed=2, target=body, cuts=cuts)
    names = ("kinetic_energy", "u", "v", "w", "x", "y", "z")
    for name, column in zip(names, brute, strict=True):
        assert distance(np.float32(column), direct.columns[name]) < 2.5, name
    of_plane = family.rate(target=plane, cuts=cuts)
    assert rate is not None
    assert of_plane is not None
    hit = brute.shape[1] / tried
    assert abs(hit * of_plane.hz / rate.hz - 1) < 5 * math.sqrt((1 - hit) / (hit * tried)) + RESOLVED


def first_met(body: Target, start: np.ndarray, d: np.ndarray) -> np.ndarray:
    """How far lines go before they enter a body; NaN where they do not."""
    with np.errstate(invalid="ignore", divide="ignore"):
        if isinstance(body, Sphere):
            along = (start * d).sum(axis=0)
            return -along - np.sqrt(along**2 - ((start**2).sum(axis=0) - body.radius**2))
        if isinstance(body, Box):
            widths = np.array(body.size)[:, None] / 2
            ends = np.sort([(-widths - start) / d, (widths - start) / d], axis=0)
            enters, leaves = ends[0].max(axis=0), ends[1].min(axis=0)
            return np.where(enters <= leaves, enters, np.nan)
        assert isinstance(body, Cylinder)
        a = (d[:2] ** 2).sum(axis=0)
        b = (start[:2] * d[:2]).sum(axis=0)
        c = (start[:2] ** 2).sum(axis=0) - body.radius**2
        root = np.sqrt(b * b - a * c)
        side = (-b - root) / a
        z = start[2] + side * d[2]
        on_side = (side >= 0) & (np.abs(z) <= body.height / 2)
        return np.where(c <= 0, 0.0, np.where(on_side, side, np.nan))


def test_a_spheres_muons_weighted_by_cos_zenith_are_the_planes(family: Generator):
    """The weighted distribution of cos zenith at ten places, at 5 standard deviations: 6e-6 false alarms."""
    n = 1_000_000
    sphere = family.sample(n, seed=1, target=Sphere(1)).cos_zenith.astype(float)
    for place in np.linspace(0.1, 1, 10):
        share = (sphere * (sphere <= place)).mean() / sphere.mean()
        assert abs(share - place**4) < 5 * 1.2 * math.sqrt(share * (1 - share * 0.999) / n) + 1e-5


def test_times_come_with_a_live_time_and_a_shorter_one_is_the_beginning(family: Generator):
    box = Box(4, 4, 3)
    long, short = (family.sample(seed=3, live_time=seconds, target=box) for seconds in (100.0, 61.7))
    assert long.time is not None
    assert short.time is not None
    assert (np.diff(long.time) >= 0).all()
    assert 0 <= long.time[0] <= long.time[-1] < 100
    assert len(short) == np.count_nonzero(long.time < 61.7)
    assert are_equal(short, long[: len(short)])
    assert are_equal(family.sample(len(short), seed=3, target=box), Muons(**{**short.columns, "time": None}))
    rate = family.rate(target=box)
    assert rate is not None
    assert abs(len(long) - 100 * rate.hz) < 5 * math.sqrt(100 * rate.hz)
    assert family.number_in_live_time(100.0, None, 3, target=box) == len(long)


@pytest.mark.parametrize(
    "chosen",
    [
        {"target": Box(4, 4, 3), "cuts": Cuts(energy_min=2), "live_time": 100.0},
        {"target": Plane(2, 5), "live_time": 1e3},
        {"live_time": 1e3, "area": 10.0, "cuts": Cuts(zenith_max=20)},
        {"n": 100_000, "target": Ball(1.0, 1.2)},
    ],
    ids=str,
)
def test_shards_with_places_and_times_merge_to_the_single_run_which_is_good(
    family: Generator, chosen: dict, tmp_path: Path
):
    family.write(tmp_path / "all.h5", seed=1, **chosen)
    parts = [tmp_path / f"{i}.h5" for i in (1, 2, 3)]
    for i, path in enumerate(parts, start=1):
        family.write(path, seed=1, shard=Shard(i, 3), **chosen)
        assert check_file(path).defects == []
    merge_shards(parts, tmp_path / "merged.h5")
    assert check_file(tmp_path / "merged.h5").defects == []
    whole = read_muons(tmp_path / "all.h5")
    assert are_equal(read_muons(tmp_path / "merged.h5"), whole)
    said = read_attributes(tmp_path / "all.h5")
    rate = family.rate(target=chosen.get("target"), cuts=chosen.get("cuts", Cuts()))
    assert rate is not None
    if "target" in chosen:
        assert said["target_live_time_s"] == len(whole) / rate.hz
        assert said["target_size_m"] == list(chosen["target"].size)
        assert "rate_hz_per_m2" not in said
    else:
        assert said["rate_hz_per_m2"] == rate.hz
    assert ("fraction_kept" in said) == ("cuts" in chosen)


def test_a_body_whose_top_and_foot_have_other_rates_is_noted_once_with_both(tmp_path: Path):
    generator = opened(tmp_path, analytic_family())
    noted = r"83\.334 a second and m2 come to its top, at 9\.4 m, and 78\.481 to its foot, at 10\.6 m"
    with pytest.warns(UserWarning, match=noted):
        generator.sample(10, target=Box(4, 4, 1.2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        generator.sample(10, target=Box(4, 4, 1.2))
        generator.sample(10, target=Box(4, 4, 0.5))


def test_a_body_is_refused_where_there_is_no_flux_through_a_sphere(tmp_path: Path):
    generator = opened(tmp_path, tiny_model())
    assert len(generator.sample(10, target=Plane(1, 1))) == 10
    with pytest.raises(RefusedError, match="and a box needs those of a sphere, which come from all sides: take"):
        generator.sample(10, target=Box(1, 1, 1))


@pytest.mark.usefixtures("released_families")
def test_a_body_is_refused_with_the_released_family_of_the_models_flux_and_medium(tmp_path: Path):
    families = {
        ("cry", "water"): "quantile-water.onnx of the released models",
        ("measured", "rock"): "measured-rock.onnx of the released models",
        ("gccly", "rock"): "a family (deepmuon-train family)",
    }
    for (flux, medium), instead in families.items():
        generator = opened(tmp_path, tiny_model(metadata={"flux": flux, "medium": medium}))
        with pytest.raises(RefusedError, match=f": take {re.escape(instead)}$"):
            generator.sample(10, target=Box(1, 1, 1))


@pytest.mark.parametrize(
    ("chosen", "reason"),
    [
        ({"n": 10, "live_time": 1.0, "target": Sphere(1)}, "the live time decides the number"),
        ({"n": 10, "area": 1.0}, "an area goes with a live time"),
        ({"live_time": 1.0, "area": 1.0, "target": Sphere(1)}, "the sphere has its own area"),
        ({"live_time": 1.0}, "a live time goes with an area or a target"),
        ({"live_time": -3.0, "area": -2.0}, r"-3\.0 is no live time in seconds: a number above 0 is"),
        ({"live_time": 3.0, "area": -2.0}, r"-2\.0 is no area in m2: a number above 0 is"),
        ({"live_time": 0.0, "area": 1.0}, "0 muons are expected .* should be above 0"),
        ({"live_time": 1e300, "target": Sphere(1)}, "muons are expected in 1e+300 s on the sphere"),
        ({"n": 10, "target": "box"}, "'box' is no target"),
        ({"n": 10, "cuts": 5}, "5 are no cuts"),
        ({"n": 10, "target": [1]}, "is no target: it is not hashable"),
        ({"n": 10, "cuts": Cuts(energy_min=1e9)}, "no muon is left: those of .* have kinetic energies from 1e-08 to"),
        ({"n": 10, "cuts": Cuts(energy_min=9e7)}, "has no muon, or less than one in a million million"),
        ({"n": 10, "cuts": Cuts(zenith_min=89.99)}, "the cuts keep none of .* muons"),
    ],
)
def test_what_can_not_be_chosen_is_refused(family: Generator, chosen: dict, reason: str):
    with pytest.raises(RefusedError, match=reason.replace("+", r"\+")):
        family.sample(**chosen)
