from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime.latents.stream import model_stream

PAGE = Path(__file__).parents[3] / "docs" / "random_numbers.md"


def documented() -> list[tuple[str, str, str, int, float, int]]:
    """Return the rows of the page's table of streams."""
    row = re.compile(r"^\| `(.*)/(.*)/(.*)/(\d)/` \| (\S+) \| `0x([0-9a-f]{16})` \|$", re.MULTILINE)
    return [
        (architecture, flux, medium, int(surface), float(depth), int(stream, 16))
        for architecture, flux, medium, surface, depth, stream in row.findall(PAGE.read_text(encoding="utf-8"))
    ]


def test_streams_are_those_of_the_documentation():
    rows = documented()
    assert len(rows) >= 5
    for *description, stream in rows:
        assert model_stream(*description) == stream


def test_the_hash_is_the_published_one():
    """Of "a" the FNV-1a hash is af63dc4c8601ec8c: here it is undone from the last byte on."""
    undo = pow(0x100000001B3, -1, 2**64)
    state = model_stream("a", "", "", 0, 0.0)
    for byte in reversed(b"///0/\0\0\0\0"):
        state = state * undo % 2**64 ^ byte
    assert state == 0xAF63DC4C8601EC8C


@given(st.floats(0, 1e4, width=32), st.floats(0, 1e4, width=32))
def test_two_depths_have_two_streams(one, other):
    streams = {model_stream("quantile", "cry", "G4_WATER", 0, depth) for depth in (one, other)}
    assert len(streams) == len({one, other})


@given(st.floats(0, 1e30))
def test_a_depth_counts_as_float32(depth):
    streams = {model_stream("quantile", "cry", "rock", 0, metres) for metres in (depth, float(np.float32(depth)))}
    assert len(streams) == 1


def test_a_depth_beyond_float32_has_a_stream_too():
    assert 0 <= model_stream("quantile", "cry", "rock", 0, 1e300) < 2**64
