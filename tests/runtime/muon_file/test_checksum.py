from __future__ import annotations

import subprocess
import sys
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime import read_muons
from deepmuon_runtime.muon_file import checksum
from deepmuon_runtime.muon_file.checksum import joined_crc32

WITHOUT_ISAL = """
import sys
sys.modules["isal"] = None
from zlib import crc32
from deepmuon_runtime import Generator
from deepmuon_runtime.muon_file import checksum
assert checksum.crc32 is crc32
Generator.open(file=sys.argv[1]).write("muons.h5", 200_000, seed=1)
"""


def test_the_faster_checksum_is_the_same():
    pytest.importorskip("isal", reason="the extra `fast` is not installed")

    @given(st.binary(max_size=10_000), st.integers(0, 2**32 - 1))
    def same(data, before):
        assert checksum.crc32(data, before) == crc32(data, before)

    assert checksum.crc32 is not crc32
    same()


def test_without_the_extra_fast_a_file_has_the_checksums_that_all_who_read_find(tmp_path, model_file):
    subprocess.run([sys.executable, "-c", WITHOUT_ISAL, model_file], cwd=tmp_path, check=True)
    assert len(read_muons(tmp_path / "muons.h5")) == 200_000


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
