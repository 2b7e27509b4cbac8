from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.data.cry_text import read_cry_text

# CRY 1.7's own, but for the positron and photon that share the event of a muon.
SHOWER = """\
# nEvent nSecondary KE x y z u v w
 0 0 4 1413.5 0.131664 -0.492707 0 0.26661 0.254994 -0.929461
 1 0 6 4.7737 -0.395969 -0.0585462 0 -0.24014 -0.292081 -0.925755
 2 0 6 5.30097 -0.104138 0.440065 0 -0.510496 -0.263799 -0.818415
 3 0 4 21.2691 0.352818 0.00437914 0 0.197489 0.270145 -0.942348
 3 1 4 135.913 0.235634 -0.0520156 0 -0.372526 -0.182654 -0.909869
 3 2 5 12.2509 -0.405063 0.298132 0 -0.18575 -0.417816 -0.889341
"""
LINES = SHOWER.splitlines(keepends=True)


@pytest.fixture
def read(tmp_path):
    def run(text: str):
        path = tmp_path / "shower.out"
        path.write_text(text, encoding="latin-1")
        return read_cry_text(path)

    return run


def test_the_muons_are_found_in_gev_with_unit_directions_and_no_charge(read):
    found = read(SHOWER)
    assert found.particles == 6
    np.testing.assert_allclose(found.muons.kinetic_energy, [1.4135, 0.0212691, 0.135913], rtol=1e-6)
    np.testing.assert_allclose(found.muons.u, [0.26661, 0.197489, -0.372526], atol=1e-5)
    np.testing.assert_allclose(found.muons.w, [-0.929461, -0.942348, -0.909869], atol=1e-5)
    length = sum(getattr(found.muons, name).astype(float) ** 2 for name in "uvw")
    np.testing.assert_allclose(length, 1, atol=1e-6)
    np.testing.assert_array_equal(found.muons.pdg_id, [0, 0, 0])


def test_the_number_of_muons_varies_as_its_showers_make_it(read):
    assert read(SHOWER).count_variance == pytest.approx((1**2 + 2**2) / 3)  # a shower of one, and one of two
    one_by_one = "".join(line for line in LINES if not line.startswith(" 3 1"))
    assert read(one_by_one).count_variance == 1


def test_runs_that_follow_each_other_have_showers_of_their_own(read):
    first, second = LINES[1:2], LINES[1:5]
    assert read("".join(second + first + first)).count_variance == pytest.approx((1 + 1 + 2**2) / 4)


def test_a_file_without_its_header_is_read(read):
    assert len(read(SHOWER.split("\n", 1)[1]).muons) == 3


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (" 4 0 4 1413.5 0.13 -0.49 0 0.26661 0.254994", "is no row of 10 columns"),
        (" 4 0 4 1413.5 0.13 -0.49 0 0.26661 0.254994 -0.929461 1", "is no row of 10 columns"),
        ("GEANT4 run 1", "is no row of 10 columns"),
        (" 4 0 muon 1413.5 0.13 -0.49 0 0.26661 0.254994 -0.929461", "is no row of 10 columns"),
        (" 4 0 7 1413.5 0.13 -0.49 0 0.26661 0.254994 -0.929461", "begins with 4 0 7, not with an event"),
        (" 4 0 13 1413.5 0.13 -0.49 0 0.26661 0.254994 -0.929461", "begins with 4 0 13, not with an event"),
        (" 4 0.5 4 1413.5 0.13 -0.49 0 0.26661 0.254994 -0.929461", "begins with 4 0.5 4, not with an event"),
        (" nan 0 4 1413.5 0.13 -0.49 0 0.26661 0.254994 -0.929461", "begins with nan 0 4, not with an event"),
        (" 4 0 4 nan 0.13 -0.49 0 0.26661 0.254994 -0.929461", "kinetic energy that is negative or not finite"),
        (" 4 0 4 -3 0.13 -0.49 0 0.26661 0.254994 -0.929461", "kinetic energy that is negative or not finite"),
        (" 4 0 4 1e60 0.13 -0.49 0 0.26661 0.254994 -0.929461", "kinetic energy that is negative or not finite"),
        (" 4 0 4 1413.5 0.13 -0.49 0 0.26661 0.254994 0.929461", "does not go down"),
        (" 4 0 4 1413.5 0.13 -0.49 0 1 0 0", "does not go down"),
        (" 4 0 4 1413.5 0.13 -0.49 0 0.26661 0.254994 -0.8", "direction whose length is not 1"),
        (" 4 0 4 1413.5 0.13 -0.49 0 0 0 0", "direction whose length is not 1"),
        (" 4 0 4 1413.5 0.13 -0.49 0 0.26661 inf -0.9", "direction whose length is not 1"),
    ],
)
def test_a_line_that_is_not_crys_or_no_muon_is_named(read, line, reason):
    with pytest.raises(RefusedError, match=r"shower\.out, line 5") as refusal:
        read("".join([*LINES[:4], line, "\n", *LINES[1:]]))
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_truncated_file_is_refused(read):
    for end in (1, 3, 8, 40):
        with pytest.raises(RefusedError, match="line 7"):
            read(SHOWER[:-end])


def test_a_file_without_muons_is_refused(read):
    with pytest.raises(RefusedError, match="has 1 particles, and no muon"):
        read(LINES[2])
    with pytest.raises(RefusedError, match="no line of numbers"):
        read(LINES[0])


PARTICLES = st.lists(
    st.tuples(st.sampled_from([0, 1, 4, 5, 6]), st.floats(1, 1e6), st.floats(0, 1.5), st.floats(-3, 3))
)


@given(particles=PARTICLES)
def test_what_cry_prints_comes_back_to_its_six_digits(tmp_path_factory, particles):
    path = tmp_path_factory.mktemp("cry") / "shower.out"
    particles = [(4, 100.0, 0.5, 0.5), *particles]
    with path.open("w") as file:
        for event, (kind, energy, zenith, azimuth) in enumerate(particles):
            u, v = np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth)
            file.write(f" {event} 0 {kind} {energy:g} 0.1 0.2 0 {u:g} {v:g} {-np.cos(zenith):g}\n")
    muons = read_cry_text(path).muons
    _, energy, zenith, _ = zip(*(particle for particle in particles if particle[0] == 4), strict=True)
    np.testing.assert_allclose(muons.kinetic_energy, 1e-3 * np.array(energy), rtol=6e-6)
    np.testing.assert_allclose(muons.cos_zenith, np.cos(zenith), rtol=1e-5, atol=1e-6)
