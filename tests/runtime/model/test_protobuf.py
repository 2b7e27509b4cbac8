from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime.model.protobuf import fields

NUMBERS = st.integers(1, 2**29 - 1)
VALUES = st.one_of(
    st.integers(0, 2**64 - 1).map(lambda value: (0, value)),
    st.binary(min_size=8, max_size=8).map(lambda value: (1, value)),
    st.binary(max_size=300).map(lambda value: (2, value)),
    st.binary(min_size=4, max_size=4).map(lambda value: (5, value)),
)


def varint(number: int) -> bytes:
    low, rest = number & 127, number >> 7
    return bytes([low | 128]) + varint(rest) if rest else bytes([low])


def encoded(number: int, wire_type: int, value: int | bytes) -> bytes:
    tag = varint(number << 3 | wire_type)
    if isinstance(value, int):
        return tag + varint(value)
    return tag + (varint(len(value)) if wire_type == 2 else b"") + value


@given(st.lists(st.tuples(NUMBERS, VALUES)))
def test_the_fields_of_a_message_are_those_it_was_made_of(content):
    message = b"".join(encoded(number, *value) for number, value in content)
    assert [(number, value) for number, value in fields(memoryview(message))] == [
        (number, value) for number, (_, value) in content
    ]


@given(st.binary(max_size=100))
def test_any_bytes_are_a_message_or_refused(content):
    with contextlib.suppress(ValueError):
        assert sum(1 for _ in fields(memoryview(content))) <= len(content) / 2


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"\x00\x01", "has the number 0"),
        (b"\x80\x80\x80\x80\x10\x01", "has the number"),
        (b"\x0b", "has the wire type 3"),
        (b"\x0f", "has the wire type 7"),
        (b"\x08", "a number is cut off"),
        (b"\x08\x80", "a number is cut off"),
        (b"\x08" + b"\xff" * 10 + b"\x01", "more than ten bytes"),
        (b"\x0a\x02a", "a field is cut off"),
        (b"\x0a\xff\xff\xff\xff\xff\xff\xff\xff\x7fa", "a field is cut off"),
        (b"\x0d\x00\x00\x00", "a field is cut off"),
        (b"\x09\x00", "a field is cut off"),
    ],
)
def test_what_is_no_message_is_refused(content, reason):
    with pytest.raises(ValueError, match=reason):
        list(fields(memoryview(content)))
