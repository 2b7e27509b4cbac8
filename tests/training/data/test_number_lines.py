from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import deepmuon_training.data.number_lines
from deepmuon_runtime.errors import RefusedError
from deepmuon_training.data.number_lines import read_number_lines


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Read a text in pieces of a few lines: line numbers and rows."""
    monkeypatch.setattr(deepmuon_training.data.number_lines, "PIECE", 64)

    def run(text: str | bytes, columns: int = 3, **options: bool) -> tuple[list[int], np.ndarray]:
        path = tmp_path / "numbers.txt"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        pieces = list(read_number_lines(path, columns, **options))
        return [line for line, _ in pieces], np.concatenate([numbers for _, numbers in pieces])

    return run


@pytest.mark.parametrize("separator", [",", " ", "\t", " , "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("last", ["", "\n", "\n\n\n \n"])
def test_numbers_are_read_in_pieces(read, separator, end, last):
    numbers = np.arange(300.0).reshape(100, 3) / 7
    text = end.join(separator.join(map(repr, row)) for row in numbers.tolist()) + last
    lines, found = read(text)
    np.testing.assert_array_equal(found, numbers)
    assert lines[0] == 1
    assert len(lines) > 10


@pytest.mark.parametrize(
    ("header", "first"),
    [("# a 1 2 3\n", 2), ("E, u, v\n", 2), ("\n\n# made 2025\nE u v\n", 5), ("", 1), ("\ufeffE,u,v\n", 2)],
)
def test_a_header_is_passed_over_and_its_lines_count(read, header, first):
    lines, numbers = read(header + "1 2 3\n4 5 6\n")
    assert lines[0] == first
    np.testing.assert_array_equal(numbers, [[1, 2, 3], [4, 5, 6]])


GOOD = "1 2 3\n" * 40


@pytest.mark.parametrize(
    "bad", ["1 2", "1 2 3 4", "1 2 three", "", "# 1 2", "1,2,3", "1 2 0x3", "1 2 3j", "1 2 1_0", "1 2 3\r4", "\xe9 1 2"]
)
@pytest.mark.parametrize("before", [1, 13, 40])
def test_a_line_that_is_not_so_many_numbers_is_named(read, bad, before):
    with pytest.raises(RefusedError, match=rf"numbers.txt, line {before + 1}: .* is not 3 numbers$") as refusal:
        read("1 2 3\n" * before + bad + "\n" + GOOD)
    assert str(refusal.value).isprintable()


def test_of_several_bad_lines_the_first_is_named(read):
    with pytest.raises(RefusedError, match="line 42: 'x y 1'"):
        read(f"E u v\n{GOOD}x y 1\n{GOOD}1 2\n")


@pytest.mark.parametrize("text", ["", "\n \n", "E,u,v\n", "# nothing\n", "words\n" * 100, "no end", b"\x00" * 200])
def test_a_file_without_a_line_of_numbers_is_refused(read, text):
    with pytest.raises(RefusedError, match=r"numbers\.txt has no line of 3 numbers"):
        read(text)


def test_a_line_longer_than_any_is_refused(read):
    with pytest.raises(RefusedError, match="a line of more than 64 bytes"):
        read("1 2 3\n" + "1 " * 1000)


def test_a_last_line_without_an_end_is_refused_where_it_must_have_one(read):
    assert len(read(GOOD, ends_with_newline=True)[1]) == 40
    with pytest.raises(RefusedError, match="line 41 has no end: the file was cut off"):
        read(f"{GOOD}1 2 3", ends_with_newline=True)


@pytest.mark.parametrize(("kind", "reason"), [("missing", "No such file"), ("folder", "Is a directory")])
def test_what_is_no_file_is_refused(tmp_path, kind, reason):
    (tmp_path / "folder").mkdir()
    with pytest.raises(RefusedError, match=reason):
        list(read_number_lines(tmp_path / kind, 3))


ROWS = st.lists(st.tuples(*[st.floats()] * 3), min_size=1, max_size=50)


@given(rows=ROWS, separator=st.sampled_from([",", " ", "\t"]), header=st.sampled_from(["", "# 1 2 3\n", "a,b,c\n"]))
def test_whatever_numbers_are_written_come_back(tmp_path_factory, rows, separator, header):
    path = tmp_path_factory.mktemp("numbers") / "numbers.txt"
    path.write_text(header + "".join(separator.join(map(repr, row)) + "\n" for row in rows), encoding="ascii")
    found = np.concatenate([numbers for _, numbers in read_number_lines(path, 3)])
    np.testing.assert_array_equal(found, np.array(rows))


@given(text=st.binary(max_size=300))
def test_any_bytes_are_numbers_or_are_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("bytes") / "numbers.txt"
    path.write_bytes(text)
    with suppress(RefusedError):
        assert all(numbers.shape[1] == 2 for _, numbers in read_number_lines(path, 2))
