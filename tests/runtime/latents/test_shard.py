from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime import RefusedError
from deepmuon_runtime.latents.shard import WHOLE_RUN, Shard


@given(total=st.integers(0, 2**53), of=st.integers(1, 50))
def test_shards_cover_a_run_without_gap_or_overlap_and_are_equally_large(total, of):
    parts = [Shard(number, of).numbers(total) for number in range(1, of + 1)]
    assert [part.start for part in parts] == [0, *(part.stop for part in parts[:-1])]
    assert parts[-1].stop == total
    sizes = [len(part) for part in parts]
    assert max(sizes) - min(sizes) <= 1


@given(number=st.integers(1, 10**18 - 1), more=st.integers(0, 100))
def test_a_shard_is_read_from_its_text(number, more):
    shard = Shard(number, min(number + more, 10**18 - 1))
    assert Shard.parse(str(shard)) == shard


def test_the_whole_run_is_a_shard():
    assert str(WHOLE_RUN) == "1/1"
    assert WHOLE_RUN.numbers(10) == range(10)


@pytest.mark.parametrize(
    "text", ["", "1", "1/", "/2", "0/2", "3/2", "-1/2", "1/0", "0/0", "1.0/2", "1 / 2", "1/2\n", "¹/2"]
)
def test_what_is_no_shard_is_refused_in_one_line(text):
    with pytest.raises(RefusedError, match="shard") as refusal:
        Shard.parse(text)
    assert "\n" not in str(refusal.value)
