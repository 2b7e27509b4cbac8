from __future__ import annotations

from zlib import crc32

from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime.muon_file.checksum import joined_crc32


@given(st.lists(st.binary(max_size=1000)))
def test_the_checksum_of_parts_is_that_of_the_whole(parts):
    assert joined_crc32((crc32(part), len(part)) for part in parts) == crc32(b"".join(parts))


def test_the_length_may_be_that_of_any_file():
    """2^40 zeros are as many as 2^20 times 2^20 of them."""
    million = crc32(bytes(1 << 20)), 1 << 20
    assert joined_crc32([million] * 4) == joined_crc32([(crc32(bytes(1 << 22)), 1 << 22)])
    doubled = million
    for _ in range(20):
        doubled = joined_crc32([doubled, doubled]), 2 * doubled[1]
    assert joined_crc32([(crc32(b"muon"), 4), doubled]) == joined_crc32(
        [(crc32(b"muon"), 4), *[doubled_half(doubled)] * 2]
    )


def doubled_half(whole: tuple[int, int]) -> tuple[int, int]:
    half = crc32(bytes(1 << 20)), 1 << 20
    while half[1] * 2 < whole[1]:
        half = joined_crc32([half, half]), 2 * half[1]
    return half
