from __future__ import annotations

import gzip
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import deepmuon_training.data.foreign.lines
from deepmuon_runtime.errors import RefusedError
from deepmuon_training.data.foreign.text_table import open_text


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Read all columns of a text in pieces of a few lines: where each row stands, and the rows."""
    monkeypatch.setattr(deepmuon_training.data.foreign.lines, "PIECE", 64)

    def run(text: str | bytes, columns: int = 3, **options: bool) -> tuple[list[str], np.ndarray]:
        path = tmp_path / "numbers.txt"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        pieces = list(open_text(path, columns, **options).rows(range(columns)))
        places = [place(row).removeprefix(f"{path}, ") for place, rows in pieces for row in range(len(rows))]
        return places, np.concatenate([rows for _, rows in pieces])

    return run


@pytest.mark.parametrize("separator", [",", " ", "\t", " , ", ";", "; "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("last", ["", "\n", "\n\n\n \n"])
def test_numbers_are_read_in_pieces(read, separator, end, last):
    numbers = np.arange(300.0).reshape(100, 3) / 7
    text = end.join(separator.join(map(repr, row)) for row in numbers.tolist()) + last
    places, found = read(text)
    np.testing.assert_array_equal(found, numbers)
    assert places == [f"line {number}" for number in range(1, 101)]


@pytest.mark.parametrize(
    ("header", "first"),
    [
        ("# a 1 2 3\n", 2),
        ("E, u, v\n", 2),
        ("\n\n# made 2025\nE u v\n", 5),
        ("", 1),
        ("\ufeffE,u,v\n", 2),
        ('"E","u","v"\n', 2),
        ("  # E\n \t \n", 3),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "gzip"])
def test_comments_blank_lines_and_one_heading_are_passed_over_and_count(read, header, first, encoding):
    separator = "," if "," in header else " "
    text = header + "1 2 3\n\n# between\n4 5 6\n".replace(" ", separator)
    packed = gzip.compress(text.encode()) if encoding == "gzip" else text.replace("\ufeff", "").encode(encoding)
    places, numbers = read(packed if encoding != "utf-8" else text)
    assert places == [f"line {first}", f"line {first + 3}"]
    np.testing.assert_array_equal(numbers, [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize(
    ("written", "meant"),
    [("2.0D+00", 2.0), ("1.5d-3", 1.5e-3), ("-.5D2", -50.0), ("1.25-101", 1.25e-101), ("1.+100", 1e100), ("1.D0", 1.0)],
)
def test_exponents_are_fortrans_too(read, written, meant):
    np.testing.assert_array_equal(read(f"1 2 3\n{written} 2 3\n4 {written} {written}\n")[1][1:, 0], [meant, 4])


def test_numbers_in_quotes_are_numbers(read):
    np.testing.assert_array_equal(read('"1","2.5","-3"\n4,5,6\n')[1], [[1, 2.5, -3], [4, 5, 6]])


def test_columns_that_are_not_wanted_may_hold_text(tmp_path):
    path = tmp_path / "named.txt"
    path.write_text('name,E,u,v\n"mu-, of CRY",1,2,3\nNA,4,5,6\n')
    table = open_text(path)
    assert table.headings == ("name", "E", "u", "v")
    ((place, rows),) = table.rows([3, 1])
    np.testing.assert_array_equal(rows, [[3, 1], [6, 4]])
    assert place(1) == f"{path}, line 3"


GOOD = "1 2 3\n" * 40


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        ("1 2", "it has 2"),
        ("1 2 3 4", "it has 4"),
        ("1 2 three", "'three' is no number"),
        ("1,2,3", "it has 1"),
        ("1 2 0x3", "'0x3' is no number"),
        ("1 2 3j", "'3j' is no number"),
        ("1 2 1_0", "'1_0' is no number"),
        ("1 NA 3", "'NA' is no number"),
        ("1 2 ****", "'****' is no number"),
        ("\xe9 1 2", "'\\xe9' is no number"),
        ("E u v", "'E' is no number"),
        ("1,5 2,0 3,0", "it looks like decimal commas, write decimal points"),
        ("1 2 3 # first", "it has 5"),
    ],
)
@pytest.mark.parametrize("before", [1, 13, 40])
def test_a_line_that_is_no_row_is_named(read, bad, why, before):
    with pytest.raises(RefusedError) as refusal:
        read("1 2 3\n" * before + bad + "\n" + GOOD)
    error = str(refusal.value)
    assert f"numbers.txt, line {before + 1}: " in error
    assert error.endswith(f" is no row of 3 columns: {why}")
    assert error.isprintable()


@pytest.mark.parametrize(
    ("top", "reason"),
    [
        ("NA,NA,NA", "line 1: 'NA,NA,NA' is no row of 3 columns: 'NA' is no number"),
        ("NA,nan,null", "line 1: 'NA,nan,null' is no row of 3 columns: 'NA' is no number"),
        ("a,a,b", "line 1: 'a,a,b' is no row"),
        ("E,u,3", "line 1: 'E,u,3' is no row of 3 columns: 'E' is no number"),
        ("my muons", "line 1: 'my muons' is no heading of 3 columns: a comment begins with #"),
        ("run 5", "line 1: 'run 5' is no row of 3 columns: it has 2"),
        ("1,5;2,5;3,5", "line 1: '1,5;2,5;3,5' is no row of 3 columns: it looks like decimal commas"),
        ("E,u,v\nMeV,-,-", "line 2: 'MeV,-,-' is no row of 3 columns: 'MeV' is no number"),
    ],
)
def test_a_first_line_is_numbers_a_heading_or_refused(read, top, reason):
    with pytest.raises(RefusedError, match=r"numbers\.txt") as refusal:
        read(f"{top}\n1,2,3\n4,5,6\n")
    assert reason in str(refusal.value)


def test_of_several_bad_lines_the_first_is_named(read):
    with pytest.raises(RefusedError, match="line 42: 'x y 1'"):
        read(f"E u v\n{GOOD}x y 1\n{GOOD}1 2\n")


def test_a_quote_without_an_end_hides_no_line(read):
    with pytest.raises(RefusedError, match=r"line 3: .* is no row of 3 columns: a quote has no end"):
        read('1,2,3\n1,2,3\n1,2,"3\n1,2,3\n')


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "has no line of numbers: it is empty"),
        ("\n \n", "has no line of numbers: it is empty"),
        ("E,u,v\n", "has no line of numbers: it holds a heading alone"),
        ("# nothing\n", "has no line of numbers: it holds comments alone"),
        ("words\n" * 100, "line 1: 'words' is no row of 3 columns: it has 1"),
        (b"\x00" * 200, "is no text: it holds zero bytes"),
        ("1 2 3\n".encode("utf-16-le"), "is no text: it holds zero bytes"),
        (b"\x93NUMPY", "is a NumPy file, for --format npy"),
        (b"root\0\0", "is a ROOT file, for --format root"),
        (b"PK\x03\x04", "is a zip archive or a spreadsheet"),
        (gzip.compress(b"1 2 3\n" * 100)[:-9], "can't be read"),
        ("1 2 3\n".encode("utf-16")[:-1], "can't be read"),
    ],
)
def test_what_is_no_text_of_numbers_is_refused(read, text, reason):
    with pytest.raises(RefusedError, match=r"numbers\.txt") as refusal:
        read(text)
    assert reason in str(refusal.value)


def test_a_line_longer_than_any_is_refused(read):
    with pytest.raises(RefusedError, match="line 2 has more than 64 characters"):
        read("1 2 3\n" + "1 " * 1000)


def test_a_last_line_without_an_end_is_refused_where_it_must_have_one(read):
    assert len(read(GOOD, ends_with_newline=True)[1]) == 40
    with pytest.raises(RefusedError, match="line 41 has no end: the file was cut off"):
        read(f"{GOOD}1 2 3", ends_with_newline=True)


@pytest.mark.parametrize(("kind", "reason"), [("missing", "No such file"), ("folder", "Is a directory")])
def test_what_is_no_file_is_refused(tmp_path, kind, reason):
    (tmp_path / "folder").mkdir()
    with pytest.raises(RefusedError, match=reason):
        open_text(tmp_path / kind, 3)


def fortran(number: float) -> str:
    """A number as Fortran writes it, which leaves the letter out where the exponent has three digits."""
    mantissa, mark, exponent = f"{number:.16e}".partition("e")
    return f"{mantissa}{'D' if len(exponent) < 4 else ''}{exponent}" if mark else mantissa


FORMATS = {"python": repr, "C": "{:.17g}".format, "fortran": fortran, "quoted": lambda number: f'"{number!r}"'}
ROWS = st.lists(st.tuples(*[st.floats()] * 3), min_size=1, max_size=50)


@given(
    rows=ROWS,
    form=st.sampled_from(list(FORMATS)),
    separator=st.sampled_from([",", " ", "\t", ";", " ; "]),
    header=st.sampled_from(["", "# 1 2 3\n", "a{0}b{0}c\n"]),
    end=st.sampled_from(["\n", "\r\n"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
def test_whatever_numbers_are_written_come_back(tmp_path_factory, rows, form, separator, header, end, encoding):
    path = tmp_path_factory.mktemp("numbers") / "numbers.txt"
    lines = "".join(separator.join(map(FORMATS[form], row)) + end for row in rows)
    path.write_bytes((header.format(separator) + lines).encode(encoding))
    found = np.concatenate([numbers for _, numbers in open_text(path, 3).rows(range(3))])
    np.testing.assert_array_equal(found, np.array(rows))


@given(text=st.binary(max_size=300))
def test_any_bytes_are_numbers_or_are_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("bytes") / "numbers.txt"
    path.write_bytes(text)
    with suppress(RefusedError):
        assert all(numbers.shape[1] == 2 for _, numbers in open_text(path, 2).rows(range(2)))
