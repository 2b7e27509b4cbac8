from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing

import pytest

from deepmuon_runtime.files.early_flush import STEP, EarlyFlush


@pytest.fixture
def cannot_be_flushed() -> Iterator[int]:
    reader, writer = os.pipe()
    yield writer
    os.close(reader)
    os.close(writer)


def test_a_file_is_flushed_however_little_or_much_was_written(tmp_path):
    for size in (0, 1, STEP, 5 * STEP):
        with (tmp_path / "file").open("wb") as file, closing(EarlyFlush(file.fileno())) as flush:
            flush.wrote(size)
            flush.wrote(size)
            flush.finish()


def test_the_failure_of_an_early_flush_comes_with_the_last(cannot_be_flushed):
    with closing(EarlyFlush(cannot_be_flushed)) as flush:
        flush.wrote(STEP)
        with pytest.raises(OSError, match="Invalid argument"):
            flush.finish()


def test_the_failure_of_an_early_flush_stops_the_writing(cannot_be_flushed):
    def write_much(flush: EarlyFlush) -> None:
        for _ in range(10_000_000):
            flush.wrote(STEP)

    with closing(EarlyFlush(cannot_be_flushed)) as flush, pytest.raises(OSError, match="Invalid argument"):
        write_much(flush)


def test_little_is_not_flushed_early(cannot_be_flushed):
    with closing(EarlyFlush(cannot_be_flushed)) as flush:
        flush.wrote(STEP - 1)
        flush.wrote(0)
