"""What is true of every format."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deepmuon_cli.options.formats import FORMATS as NAMES
from deepmuon_runtime import Generator, Muons, RefusedError, check_file, convert_file, write_muons
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX
from deepmuon_runtime.formats.registry import FORMATS, format_of, opened_muons, output_format
from deepmuon_runtime.muon_file.format import COLUMNS, OPTIONAL_COLUMNS

pytest.importorskip("uproot", reason="the extra `root` is not installed")

ABOUT = {
    "depth_m": 10.0,
    "medium": "G4_WATER",
    "source": 'a test: "µ", two\nlines',
    "provenance": ["made", "cut"],
    "seed": np.uint64(2**64 - 1),
    "smoothed": True,
    "rate_hz_per_m2": 50.0,
    "energy_min_gev": 0.2,
    "zenith_max_degrees": 80.0,
    "target": "box",
    "target_size_m": [4.0, 4.0, 3.0],
    "target_rate_hz": 7.0,
}
CUT = {"u": 2**-20, "v": 2**-20, "w": 2**-20}  # what MCPL may change, absolute; all else to float32 rounding
FORMS = pytest.mark.parametrize("name", FORMATS)


def some_columns(n: int, optional: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    random = np.random.default_rng(n)
    w = -np.sqrt(random.uniform(0.0001, 1, n))
    azimuth = random.uniform(0, 2 * np.pi, n)
    sine = np.sqrt(1 - w**2)
    columns = {
        "kinetic_energy": random.lognormal(1, 2, n),
        "u": sine * np.cos(azimuth),
        "v": sine * np.sin(azimuth),
        "w": w,
        "pdg_id": random.choice([13, -13], n),
        **{axis: random.uniform(-2, 2, n) for axis in "xyz"},
        "time": np.sort(random.uniform(0, 1e6, n)),
    }
    types = {name: dtype for name, (dtype, _) in {**COLUMNS, **OPTIONAL_COLUMNS}.items()}
    return {name: columns[name].astype(types[name]) for name in types if name in (*COLUMNS, *optional)}


def write(path: Path, columns: dict[str, np.ndarray], name: str | None = None, pieces: int = 3) -> None:
    optional = columns.keys() - COLUMNS.keys()
    with output_format(path, name).writer(path, ABOUT, optional=optional) as writer:
        edges = np.linspace(0, len(columns["w"]), pieces + 1).astype(int)
        for first, end in pairwise(edges):
            writer.append_columns({name: values[first:end] for name, values in columns.items()})


def read(path: Path) -> tuple[dict[str, object], dict[str, np.ndarray]]:
    with opened_muons(path) as source:
        pieces = list(source.pieces())
        none = dict.fromkeys(source.names, np.empty(0))
        return source.attributes, {key: np.concatenate([none[key], *(p[key] for p in pieces)]) for key in source.names}


def assert_same(found: dict[str, np.ndarray], columns: dict[str, np.ndarray], *, rounded: bool) -> None:
    assert found.keys() == columns.keys()
    for key, values in columns.items():
        if rounded:
            tolerance = 1e-15 if key == "time" else 2.0**-22
            np.testing.assert_allclose(found[key], values, rtol=tolerance, atol=CUT.get(key, 0))
        else:
            np.testing.assert_array_equal(found[key], values)


@FORMS
@pytest.mark.parametrize("optional", [(), ("x", "y", "z"), ("time",), ("x", "y", "z", "time")], ids=len)
@pytest.mark.parametrize("n", [0, 1, 5000])
def test_what_was_written_is_read_back_with_all_that_is_known_of_it(tmp_path, name, optional, n):
    path, columns = tmp_path / f"muons.{name}", some_columns(n, optional)
    write(path, columns)
    attributes, found = read(path)
    assert_same(found, columns, rounded="mcpl" in name)
    created = attributes.pop("created")
    assert created.endswith("+00:00")
    assert attributes.pop("created_by").startswith("deepmuon-runtime ")
    assert attributes == {
        **ABOUT,
        "seed": 2**64 - 1,
        "count": n,
        "live_time_s_m2": n / 50.0,
        "target_live_time_s": n / 7.0,
    }


@pytest.mark.parametrize("other", FORMATS)
@FORMS
def test_from_each_format_to_each_other_nothing_is_lost(tmp_path, name, other):
    (tmp_path / "there").mkdir()
    columns = some_columns(3000, ("x", "y", "z", "time"))
    write(tmp_path / f"muons.{name}", columns)
    convert_file(tmp_path / f"muons.{name}", tmp_path / "there" / f"muons.{other}")
    (first, _), (second, found) = read(tmp_path / f"muons.{name}"), read(tmp_path / "there" / f"muons.{other}")
    assert_same(found, columns, rounded="mcpl" in name + other)
    assert {**first, "created": ""} == {**second, "created": ""}


@FORMS
def test_what_a_generator_writes_is_good_in_every_format(tmp_path, model_file, name):
    generator = Generator.open(file=model_file, device="cpu")
    generator.write(tmp_path / "muons.h5", 200_000, seed=7)
    path = tmp_path / f"other.{name}"
    generator.write(path, 200_000, seed=7)
    report, expected = check_file(path), check_file(tmp_path / "muons.h5")
    assert report.defects == []
    assert (report.examined, report.mu_plus) == (expected.examined, expected.mu_plus)
    assert report.mean_energy == pytest.approx(expected.mean_energy, rel=1e-6)
    assert report.attributes == {**expected.attributes, "created": report.attributes["created"]}


@FORMS
@pytest.mark.parametrize("optional", [["x"], ["x", "y"], ["weight"], ["time", "z"]])
def test_columns_that_no_reader_would_take_are_refused_before_anything_is_written(tmp_path, name, optional):
    path = tmp_path / f"muons.{name}"
    with pytest.raises(RefusedError, match=rf"{optional[-1]}, which are none of a muon file"):
        output_format(path).writer(path, ABOUT, optional=optional)


@FORMS
def test_memory_whose_muons_were_written_may_be_filled_again(tmp_path, name):
    columns = some_columns(3000, ("x", "y", "z", "time"))
    path, memory = tmp_path / f"muons.{name}", {key: np.empty(1000, values.dtype) for key, values in columns.items()}
    with output_format(path).writer(path, ABOUT, optional=("x", "y", "z", "time")) as writer:
        for first in range(0, 3000, 1000):
            for key, values in columns.items():
                memory[key][:] = values[first : first + 1000]
            writer.append_columns(memory)
    assert_same(read(path)[1], columns, rounded="mcpl" in name)


@FORMS
@pytest.mark.parametrize("attribute", ["a = b", "two\nlines", "columns", "crc32", "format"])
def test_an_attribute_that_would_not_be_read_back_is_refused_before_anything_is_written(tmp_path, name, attribute):
    write_muons(tmp_path / "muons.h5", Muons.empty(0), {"depth_m": 1.0, "medium": "rock", attribute: "kept"})
    path = tmp_path / f"other.{name}"
    if name == "h5":
        convert_file(tmp_path / "muons.h5", path)
        assert read(path)[0][attribute] == "kept"
        return
    with pytest.raises(RefusedError, match="has a name that no other format than HDF5 can hold"):
        convert_file(tmp_path / "muons.h5", path)
    assert list(tmp_path.iterdir()) == [tmp_path / "muons.h5"]


@FORMS
def test_a_text_that_hdf5_gives_as_bytes_is_a_text(tmp_path, name):
    about = {"depth_m": 1.0, "medium": "rock", "note": np.bytes_("µ".encode())}
    write_muons(tmp_path / "muons.h5", Muons.empty(0), about)
    convert_file(tmp_path / "muons.h5", tmp_path / f"other.{name}")
    assert read(tmp_path / f"other.{name}")[0]["note"] in ("µ", "µ".encode())


@settings(deadline=None, max_examples=30)
@given(
    st.sampled_from(["mcpl", "mcpl.gz", "csv", "csv.gz"]),
    st.floats(0, 1, exclude_max=True),
    st.integers(1, 255),
)
def test_a_changed_byte_is_found(tmp_path_factory, name, where, change):
    path = tmp_path_factory.mktemp("damaged") / f"muons.{name}"
    write(path, some_columns(500, ("x", "y", "z")))
    content = bytearray(path.read_bytes())
    place = int(where * len(content))
    content[place] ^= change
    path.write_bytes(content)
    is_of_gzip = name.endswith(".gz") and content[:2] == b"\x1f\x8b"
    found = None
    with suppress(RefusedError):
        attributes, found = read(path)
    if found is None:
        return
    # gzip has bytes that say nothing of the content: the time, the system; MCPL the weight, and its own name.
    assert_same(found, some_columns(500, ("x", "y", "z")), rounded="mcpl" in name)
    assert attributes["target"] == "box"
    assert is_of_gzip or "mcpl" in name


@FORMS
@pytest.mark.parametrize("kept", [0, 3, 100, 2000, 10_000])
def test_a_truncated_file_is_refused_in_one_line(tmp_path, name, kept):
    write(tmp_path / "muons", some_columns(2000), name)
    (tmp_path / "muons").write_bytes((tmp_path / "muons").read_bytes()[:kept])
    with pytest.raises(RefusedError, match=r"muons.*") as refusal:
        read(tmp_path / "muons")
    assert "\n" not in str(refusal.value)


@FORMS
def test_a_file_appears_under_its_name_when_it_is_complete_and_not_before(tmp_path, name):
    path, columns = tmp_path / f"muons.{name}", some_columns(1000)
    with output_format(path).writer(path, ABOUT) as writer:
        writer.append_columns(columns)
        (partial,) = tmp_path.iterdir()
        assert partial.name.endswith(PARTIAL_SUFFIX)
    assert list(tmp_path.iterdir()) == [path]


@FORMS
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_interrupted_writer_leaves_nothing(tmp_path, name, error):
    def write_and_fail() -> None:
        path = tmp_path / f"muons.{name}"
        with output_format(path).writer(path, ABOUT) as writer:
            writer.append_columns(some_columns(1000))
            raise error

    with pytest.raises(error):
        write_and_fail()
    assert not any(tmp_path.iterdir())


@FORMS
def test_a_full_disk_is_a_failure_that_leaves_nothing(tmp_path, name):
    program = f"""
        import resource, signal
        import numpy as np
        from deepmuon_runtime import FailedError, Muons
        from deepmuon_runtime.formats.registry import output_format
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
        random = np.random.default_rng(1)
        muons = Muons(*(random.random(200_000, dtype=np.float32) for _ in range(4)), np.full(200_000, 13, np.int8))
        try:
            with output_format("muons.{name}").writer("muons.{name}", {{"depth_m": 1.0, "medium": "rock"}}) as writer:
                for _ in range(10):
                    writer.append(muons)
        except FailedError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{tmp_path.resolve()}/muons.{name} was not written: File too large\n"
    assert not any(tmp_path.iterdir())


def test_a_seed_gives_the_same_bytes_where_the_time_is_stated(tmp_path, monkeypatch, model_file):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    for name in ("mcpl", "mcpl.gz", "csv", "csv.gz"):
        for folder in "ab":
            (tmp_path / folder).mkdir(exist_ok=True)
            Generator.open(file=model_file).write(tmp_path / folder / f"muons.{name}", 1000, seed=1)
        assert (tmp_path / "a" / f"muons.{name}").read_bytes() == (tmp_path / "b" / f"muons.{name}").read_bytes()


def test_the_command_line_offers_the_formats_that_there_are():
    assert tuple(FORMATS) == NAMES


@pytest.mark.parametrize(
    ("path", "asked", "name"),
    [
        ("muons.h5", None, "h5"),
        ("muons.hdf5", None, "h5"),
        ("muons", None, "h5"),
        ("water-0.5", None, "h5"),
        ("MUONS.MCPL.GZ", None, "mcpl.gz"),
        ("muons.mcpl", "mcpl", "mcpl"),
        ("muons.csv", None, "csv"),
        ("muons.dat", "csv", "csv"),
        ("muons.root", None, "root"),
    ],
)
def test_the_end_of_a_name_decides_the_format(path, asked, name):
    assert output_format(path, asked).name == name


def test_a_name_of_one_format_and_another_one_asked_for_is_refused():
    with pytest.raises(RefusedError, match=r"muons\.root is the name of a file of the format root, and --format asks"):
        output_format("muons.root", "mcpl")
    with pytest.raises(RefusedError, match=r"there is no format 'xml': they are h5, mcpl, mcpl\.gz, root, csv"):
        output_format("muons", "xml")


@FORMS
def test_a_file_is_known_by_its_content_whatever_its_name(tmp_path, name):
    write(tmp_path / "muons.xyz", some_columns(10), name)
    assert format_of(tmp_path / "muons.xyz").name == name.removesuffix(".gz")
    assert len(read(tmp_path / "muons.xyz")[1]["w"]) == 10


def test_a_missing_package_is_named_with_the_line_that_brings_it(tmp_path, monkeypatch, model_file):
    monkeypatch.setitem(sys.modules, "uproot", None)
    with pytest.raises(RefusedError, match=r"package uproot is needed: pip install 'deepmuon-runtime\[root\]'"):
        Generator.open(file=model_file).write(tmp_path / "muons.root", 10)


@pytest.mark.parametrize(
    "content", [b"", b"1,2\n", b"MCPL003L", b"root", b"\x1f\x8b", b'# format = "deepmuon-muons"\n']
)
def test_a_file_of_no_muons_is_refused_in_one_line(tmp_path, content):
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(RefusedError, match="file") as refusal:
        read(tmp_path / "file")
    assert "\n" not in str(refusal.value)
