from __future__ import annotations

import errno
import os
import stat
import subprocess
import sys
import textwrap
import warnings
from collections.abc import Callable
from pathlib import Path
from zlib import crc32

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.muon_files import sign_attributes

from deepmuon_runtime import (
    FailedError,
    Muons,
    MuonWriter,
    RefusedError,
    read_attributes,
    read_muons,
    write_muons,
)
from deepmuon_runtime.files.output import check_output
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX
from deepmuon_runtime.files.quiet import QuietFile
from deepmuon_runtime.muon_file.reader import opened, read_pieces
from deepmuon_runtime.muon_file.virtual import VirtualColumn

PLANE = {"depth_m": 10.0, "medium": "G4_WATER"}
COLUMNS = ("kinetic_energy", "u", "v", "w", "pdg_id")


def some_muons(n: int) -> Muons:
    random = np.random.default_rng(n)
    floats = [random.random(n, dtype=np.float32) for _ in range(4)]
    return Muons(*floats, np.where(random.random(n) < 0.5, 13, -13).astype(np.int8))


def are_equal(a: Muons, b: Muons) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in COLUMNS)


@settings(deadline=None, max_examples=25)
@given(pieces=st.lists(st.integers(0, 3000), max_size=5), data=st.data())
def test_what_was_written_in_pieces_is_read_back_in_any_part(tmp_path_factory, pieces, data):
    path = tmp_path_factory.mktemp("muons") / "muons.h5"
    parts = [some_muons(n) for n in pieces]
    with MuonWriter(path, PLANE) as writer:
        for part in parts:
            writer.append(part)
    whole = Muons.concatenate([*parts, some_muons(0)])
    assert are_equal(read_muons(path), whole)
    first = data.draw(st.integers(0, len(whole)))
    count = data.draw(st.integers(0, len(whole) - first))
    assert are_equal(read_muons(path, first, count), whole[first : first + count])


def test_the_file_is_what_the_format_says(tmp_path):
    write_muons(tmp_path / "muons.h5", some_muons(5), PLANE)
    with h5py.File(tmp_path / "muons.h5") as file:
        assert dict(file.attrs) == {"format": "deepmuon-muons", "format_version": 2}
        assert set(file) == {"muons"}
        assert set(file["muons"]) == set(COLUMNS)
        for name in COLUMNS:
            column = file["muons"][name]
            assert column.dtype == (np.int8 if name == "pdg_id" else np.float32)
            assert column.attrs["units"] == ("GeV" if name == "kinetic_energy" else "1")
            assert column.chunks is not None
            assert column.compression is None


def test_attributes_come_back_as_they_were_given(tmp_path):
    given_ones = {
        **PLANE,
        "seed": 2**64 - 1,
        "smoothed": True,
        "source": "CRY 1.7, µ only",
        "provenance": ["read", "smoothed", "through 10 m of water"],
        "rate_hz_per_m2": 50.0,
        "created_by": "a test",
    }
    write_muons(tmp_path / "muons.h5", some_muons(100), given_ones)
    found = read_attributes(tmp_path / "muons.h5")
    created = found.pop("created")
    assert created.endswith("+00:00")
    assert found == {**given_ones, "count": 100, "live_time_s_m2": 2.0}
    assert found["smoothed"] is True


def test_a_few_muons_make_a_small_file(tmp_path):
    write_muons(tmp_path / "muons.h5", some_muons(10), PLANE)
    assert (tmp_path / "muons.h5").stat().st_size < 40_000


def test_a_file_that_says_nothing_of_its_plane_is_refused(tmp_path):
    with pytest.raises(RefusedError, match="depth_m and medium"):
        write_muons(tmp_path / "muons.h5", some_muons(1), {})
    assert not any(tmp_path.iterdir())


def test_nothing_has_the_name_until_the_file_is_complete(tmp_path):
    with MuonWriter(tmp_path / "muons.h5", PLANE) as writer:
        writer.append(some_muons(10))
        (partial,) = tmp_path.iterdir()
        assert partial.name.startswith("muons.h5.")
        assert partial.name.endswith(PARTIAL_SUFFIX)
    assert [path.name for path in tmp_path.iterdir()] == ["muons.h5"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_interrupted_writer_leaves_nothing(tmp_path, error):
    def write_and_fail() -> None:
        with MuonWriter(tmp_path / "muons.h5", PLANE) as writer:
            writer.append(some_muons(10))
            raise error

    with pytest.raises(error):
        write_and_fail()
    assert not any(tmp_path.iterdir())


def test_an_existing_file_is_refused_and_kept(tmp_path):
    path = tmp_path / "muons.h5"
    write_muons(path, some_muons(3), PLANE)
    with pytest.raises(RefusedError, match="exists already"):
        write_muons(path, some_muons(4), PLANE)
    assert len(read_muons(path)) == 3


def test_overwriting_replaces_the_file_at_the_end_and_not_before(tmp_path):
    path = tmp_path / "muons.h5"
    write_muons(path, some_muons(3), PLANE)
    with MuonWriter(path, PLANE, overwrite=True) as writer:
        writer.append(some_muons(4))
        assert len(read_muons(path)) == 3
    assert len(read_muons(path)) == 4


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666])
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path, mode):
    path = tmp_path / "muons.h5"
    write_muons(path, some_muons(3), PLANE)
    path.chmod(mode)
    write_muons(path, some_muons(4), PLANE, overwrite=True)
    assert (len(read_muons(path)), stat.S_IMODE(path.stat().st_mode)) == (4, mode)


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("muons.csv", "write muons.h5, and then deepmuon-convert muons.h5 muons.csv"),
        ("muons.CSV", "write muons.h5, and then deepmuon-convert muons.h5 muons.CSV"),
        ("muons.root", "write muons.h5, and then deepmuon-convert muons.h5 muons.root"),
        ("muons.parquet", "write muons.h5, and then read it in Python with deepmuon_runtime.read_muons"),
        ("muons.mcpl", "write muons.h5, and then deepmuon-convert muons.h5 muons.mcpl"),
        ("muons.mcpl.gz", "write muons.h5, and then deepmuon-convert muons.h5 muons.mcpl.gz"),
        ("muons.png", "deepmuon-plot muons.h5 -o muons.png"),
    ],
)
def test_a_name_that_promises_another_format_is_refused_with_the_way_to_it(tmp_path, name, advice):
    with pytest.raises(RefusedError, match="would be HDF5 under a name of ") as refusal:
        write_muons(tmp_path / name, some_muons(1), PLANE)
    assert advice in str(refusal.value)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["muons", "muons.h5", "muons.hdf5", "water-0.5", "csv"])
def test_any_other_name_is_good(tmp_path, name):
    write_muons(tmp_path / name, some_muons(1), PLANE)
    assert len(read_muons(tmp_path / name)) == 1


@pytest.fixture(params=[None, errno.EPERM], ids=["hard links", "no hard links"])
def file_system(request, monkeypatch):
    """A file system with hard links, and one without."""

    def refuse(source: Path, target: Path) -> None:
        raise OSError(request.param, os.strerror(request.param))

    if request.param is not None:
        monkeypatch.setattr(os, "link", refuse)


@pytest.mark.usefixtures("file_system")
def test_a_file_gets_its_name(tmp_path):
    write_muons(tmp_path / "muons.h5", some_muons(3), PLANE)
    assert len(read_muons(tmp_path / "muons.h5")) == 3
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.usefixtures("file_system")
def test_of_two_writers_one_wins_and_the_other_is_told(tmp_path):
    path = tmp_path / "muons.h5"

    def lose() -> None:
        with MuonWriter(path, PLANE) as loser:
            loser.append(some_muons(4))
            write_muons(path, some_muons(3), PLANE)

    with pytest.raises(FailedError, match="written by another process"):
        lose()
    assert len(read_muons(path)) == 3
    assert len(list(tmp_path.iterdir())) == 1


def failing(number: int) -> Callable[..., None]:
    def fail(*arguments: object) -> None:
        raise OSError(number, os.strerror(number))

    return fail


def test_a_move_that_fails_where_there_are_no_hard_links_leaves_no_empty_file(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "link", failing(errno.EPERM))
    monkeypatch.setattr(os, "replace", failing(errno.EIO))
    with pytest.raises(FailedError, match="was not written: Input/output error"):
        write_muons(tmp_path / "muons.h5", some_muons(3), PLANE)
    assert not any(tmp_path.iterdir())


def test_a_folder_that_may_be_written_but_not_read_gets_the_file(tmp_path, monkeypatch):
    """As root, who may read everything, by a call that fails."""
    open_it = os.open

    def open_no_folder(path: Path, flags: int, *mode: int) -> int:
        if os.path.isdir(path):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return open_it(path, flags, *mode)

    monkeypatch.setattr(os, "open", open_no_folder)
    write_muons(tmp_path / "muons.h5", some_muons(3), PLANE)
    assert len(read_muons(tmp_path / "muons.h5")) == 3


def test_a_name_that_can_not_be_brought_to_the_disk_is_a_warning_for_the_file_is_there(tmp_path, monkeypatch):
    flush = os.fsync

    def flush_no_folder(descriptor: int) -> None:
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        flush(descriptor)

    monkeypatch.setattr(os, "fsync", flush_no_folder)
    with pytest.warns(UserWarning, match="is complete, but a loss of power now might take its name: Input/output"):
        write_muons(tmp_path / "muons.h5", some_muons(3), PLANE)
    assert len(read_muons(tmp_path / "muons.h5")) == 3


def test_a_file_that_can_not_be_closed_leaves_nothing(tmp_path, monkeypatch):
    close = QuietFile.close

    def close_and_fail(file: QuietFile) -> None:
        close(file)
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(QuietFile, "close", close_and_fail)
    write_muons(tmp_path / "muons.h5", some_muons(3), PLANE)
    assert [path.name for path in tmp_path.iterdir()] == ["muons.h5"]
    with pytest.raises(ValueError, match="in the body"), MuonWriter(tmp_path / "other.h5", PLANE):
        raise ValueError("in the body")
    assert [path.name for path in tmp_path.iterdir()] == ["muons.h5"]


def test_the_pieces_of_a_file_are_its_muons(tmp_path):
    for n, lengths in ((0, []), (10, [4, 4, 2]), (8, [4, 4])):
        write_muons(tmp_path / f"{n}.h5", some_muons(n), PLANE)
        pieces = list(read_pieces(tmp_path / f"{n}.h5", 4))
        assert [len(piece) for piece in pieces] == lengths
        assert are_equal(Muons.concatenate([*pieces, some_muons(0)]), some_muons(n))


def test_the_sources_of_a_virtual_file_are_looked_up_once_for_all_its_pieces(tmp_path, monkeypatch):
    write_muons(tmp_path / "muons.h5", some_muons(10), PLANE)
    with MuonWriter(tmp_path / "virtual.h5", PLANE) as writer:
        signs_of_life = []
        writer.refer([tmp_path / "muons.h5"], signs_of_life.append)
    assert signs_of_life == [0] * (1 + len(COLUMNS))
    looked_up = []
    initialize = VirtualColumn.__init__

    def count(column: VirtualColumn, *arguments: object) -> None:
        looked_up.append(column)
        initialize(column, *arguments)

    monkeypatch.setattr(VirtualColumn, "__init__", count)
    assert are_equal(Muons.concatenate(list(read_pieces(tmp_path / "virtual.h5", 3))), some_muons(10))
    assert len(looked_up) == len(COLUMNS)


def test_a_folder_that_vanishes_is_a_failure(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()

    def write_into_nothing() -> None:
        with MuonWriter(folder / "muons.h5", PLANE) as writer:
            writer.append(some_muons(4))
            for path in folder.iterdir():
                path.unlink()
            folder.rmdir()

    with pytest.raises(FailedError, match="was not written"):
        write_into_nothing()


@pytest.mark.parametrize("piece", [200_000, 1000])
def test_a_full_disk_is_a_failure_that_leaves_nothing(tmp_path, piece):
    """In a process of its own: HDF5 by itself would end it by a segmentation fault."""
    program = f"""
        import resource, signal
        import numpy as np
        from deepmuon_runtime import FailedError, Muons, MuonWriter
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
        muons = Muons(*(np.ones({piece}, np.float32) for _ in range(4)), np.full({piece}, 13, np.int8))
        try:
            with MuonWriter("muons.h5", {PLANE}) as writer:
                for _ in range(200_000 // {piece}):
                    writer.append(muons)
        except FailedError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{tmp_path.resolve()}/muons.h5 was not written: File too large\n"
    assert not any(tmp_path.iterdir())


def test_a_link_is_followed(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.h5").symlink_to(tmp_path / "folder" / "muons.h5")
    write_muons(tmp_path / "link.h5", some_muons(3), PLANE)
    assert len(read_muons(tmp_path / "folder" / "muons.h5")) == 3


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "is a folder"),
        ("folder", "is a folder"),
        ("pipe", "is a device or a pipe"),
        ("loop", "is a symbolic link that leads back to itself"),
        ("missing/muons.h5", "there is no folder"),
        ("file/muons.h5", "there is no folder"),
        ("a\0b", "can't be written"),
        ("a" * 300, "can't be written"),
    ],
)
def test_a_path_that_can_not_be_a_file_is_refused(tmp_path, name, reason):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("pool")
    (tmp_path / "pool").symlink_to("loop")
    path = f"{tmp_path}/{name}"
    before = set(tmp_path.rglob("*"))
    with pytest.raises(RefusedError, match=reason):
        write_muons(path, some_muons(1), PLANE)
    assert set(tmp_path.rglob("*")) == before


def test_a_device_is_refused():
    with pytest.raises(RefusedError, match="is a device or a pipe"):
        check_output("/dev/null", overwrite=True)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(RefusedError, match="is not writable"):
        check_output(tmp_path / "muons.h5")


def spoil(path: Path, how: str) -> None:
    with h5py.File(path, "r+") as file:
        muons = file["muons"]
        if how == "no format":
            del file.attrs["format"]
        elif how == "later version":
            file.attrs["format_version"] = 3
        elif how == "no group":
            del file["muons"]
        elif how == "no count":
            del muons.attrs["count"]
        elif how == "other count":
            muons.attrs["count"] = 11
        elif how == "count of text":
            muons.attrs["count"] = "ten"
        elif how == "no column":
            del muons["u"]
        elif how == "group for a column":
            del muons["u"]
            muons.create_group("u")
        elif how == "short column":
            muons["u"].resize((9,))
        elif how == "other type":
            del muons["u"]
            muons["u"] = np.zeros(10)
        if how != "no group":
            sign_attributes(muons)


@pytest.mark.parametrize(
    "how",
    [
        "no format",
        "later version",
        "no group",
        "no count",
        "other count",
        "count of text",
        "no column",
        "group for a column",
        "short column",
        "other type",
    ],
)
def test_a_file_that_breaks_the_format_is_refused_in_one_line(tmp_path, how):
    path = tmp_path / "muons.h5"
    write_muons(path, some_muons(10), PLANE)
    spoil(path, how)
    for read in (read_muons, read_attributes):
        with pytest.raises(RefusedError, match=r"muons\.h5.*") as refusal:
            read(path)
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", [b"", b"no HDF5", b"\x89HDF\r\n\x1a\n" + bytes(100)])
def test_a_file_that_is_no_hdf5_is_refused(tmp_path, content):
    path = tmp_path / "muons.h5"
    path.write_bytes(content)
    with pytest.raises(RefusedError, match="can't be read as a muon file"):
        read_muons(path)


def test_a_truncated_file_is_refused(tmp_path):
    path = tmp_path / "muons.h5"
    write_muons(path, some_muons(100_000), PLANE)
    path.write_bytes(path.read_bytes()[:1_000_000])
    with pytest.raises(RefusedError, match="can't be read as a muon file"):
        read_muons(path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(RefusedError, match="No such file"):
        read_muons(tmp_path / "muons.h5")


@pytest.mark.parametrize(("first", "count"), [(-1, 1), (11, None), (0, 11), (5, 6), (5, -1)])
def test_muons_that_are_not_there_are_refused(tmp_path, first, count):
    write_muons(tmp_path / "muons.h5", some_muons(10), PLANE)
    with pytest.raises(RefusedError, match="holds 10 muons"):
        read_muons(tmp_path / "muons.h5", first, count)


def killed_writer(folder: Path) -> Path:
    """Kill a process that writes muons.h5, and return what it left."""
    program = f"""
        import os
        from deepmuon_runtime import MuonWriter
        with MuonWriter("muons.h5", {PLANE}):
            os.kill(os.getpid(), 9)
    """
    before = set(folder.iterdir())
    subprocess.run([sys.executable, "-c", textwrap.dedent(program)], cwd=folder, check=False)
    (left,) = set(folder.iterdir()) - before
    return left


def test_what_a_killed_writer_left_is_named_by_the_next_and_kept(tmp_path):
    left = killed_writer(tmp_path)
    with pytest.warns(UserWarning, match=f"a run that was killed left {left.name}, not complete: to be deleted"):
        write_muons(tmp_path / "muons.h5", some_muons(3), PLANE)
    assert set(tmp_path.iterdir()) == {left, tmp_path / "muons.h5"}


def test_several_leftovers_are_counted(tmp_path):
    for _ in range(3):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            killed_writer(tmp_path)
    with pytest.warns(UserWarning, match="and 2 more, not complete"):
        write_muons(tmp_path / "muons.h5", some_muons(3), PLANE)


def test_living_writers_and_those_of_other_files_are_passed_over(tmp_path):
    """A warning would be an error here."""
    left = killed_writer(tmp_path)
    left.rename(tmp_path / left.name.replace("muons", "other"))
    (tmp_path / "muons.h5.mine").touch()
    program = f"""
        import sys
        from deepmuon_runtime import MuonWriter
        with MuonWriter("muons.h5", {PLANE}, overwrite=True):
            print("ready", flush=True)
            sys.stdin.read()
    """
    living = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program)], cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert living.stdout.readline() == b"ready\n"
    write_muons(tmp_path / "muons.h5", some_muons(3), PLANE)
    living.communicate()
    assert living.returncode == 0


def checksums(path: Path) -> dict[str, int]:
    with opened(path) as file:
        return file.checksums


def test_the_checksum_of_a_column_is_that_of_its_bytes_however_they_came(tmp_path):
    muons = some_muons(5000)
    with MuonWriter(tmp_path / "muons.h5", PLANE) as writer:
        for first in range(0, 5000, 1100):
            writer.append(muons[first : first + 1100])
    assert checksums(tmp_path / "muons.h5") == {name: crc32(getattr(muons, name).tobytes()) for name in COLUMNS}


def test_only_the_last_chunk_of_a_file_is_not_full_however_the_muons_came(tmp_path):
    """That one holds zeros after the muons, which nobody reads."""
    muons = some_muons(9000)
    with MuonWriter(tmp_path / "muons.h5", PLANE) as writer:
        for first, end in ((0, 2500), (2500, 2501), (2501, 8000), (8000, 9000)):
            writer.append(muons[first:end])
    with h5py.File(tmp_path / "muons.h5") as file:
        for column in file["muons"].values():
            assert (column.chunks, column.id.get_num_chunks()) == ((2500,), 4)
            mask, last = column.id.read_direct_chunk((7500,))
            assert (mask, last[-1000 * column.dtype.itemsize :]) == (0, bytes(1000 * column.dtype.itemsize))
    assert are_equal(read_muons(tmp_path / "muons.h5"), muons)


def test_muons_of_another_type_or_order_in_memory_are_written_as_the_format_says(tmp_path):
    muons = some_muons(100)
    wide = Muons(**{name: np.repeat(getattr(muons, name).astype(float), 2)[::2] for name in COLUMNS})
    write_muons(tmp_path / "muons.h5", wide, PLANE)
    assert are_equal(read_muons(tmp_path / "muons.h5"), muons)
    assert checksums(tmp_path / "muons.h5")["u"] == crc32(muons.u.tobytes())
