from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest

from deepmuon_runtime import FailedError
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX
from deepmuon_runtime.files.publish import CONDITIONS
from deepmuon_runtime.files.whole import whole_file, write_whole

WAYS = (errno.EPERM, errno.ENOTSUP, 45, errno.EINVAL, errno.EACCES, errno.EIO, errno.EXDEV, errno.EMLINK)
"""What file systems answer to a link that they can't make; 45 is ENOTSUP of macOS."""


def write(path: Path, meanwhile: Callable[[], object], overwrite: bool = False) -> None:
    """Write a file, and let something happen before it is complete."""
    with whole_file(path, overwrite=overwrite) as file:
        file.write(b"mine")
        meanwhile()


def refuse_links(monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    def link(source, target):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "link", link)


@pytest.mark.parametrize("code", WAYS)
def test_a_file_system_without_links_gets_the_file_all_the_same(tmp_path, monkeypatch, code):
    refuse_links(monkeypatch, code)
    write_whole(tmp_path / "file", b"all")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"file": b"all"}


@pytest.mark.parametrize("code", WAYS)
def test_without_links_a_file_that_appeared_meanwhile_is_kept(tmp_path, monkeypatch, code):
    refuse_links(monkeypatch, code)
    with pytest.raises(FailedError, match="by another process meanwhile"):
        write(tmp_path / "file", lambda: (tmp_path / "file").write_bytes(b"theirs"))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"file": b"theirs"}


def test_a_link_that_was_made_but_is_reported_as_taken_is_made(tmp_path, monkeypatch):
    """As over NFS, where the answer to the first request was lost."""
    link = os.link

    def link_twice(source, target):
        link(source, target)
        link(source, target)

    monkeypatch.setattr(os, "link", link_twice)
    write_whole(tmp_path / "file", b"all")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"file": b"all"}


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_temporary_file_that_was_exchanged_is_neither_published_nor_removed(tmp_path, overwrite):
    def exchange():
        (partial,) = tmp_path.iterdir()
        partial.unlink()
        partial.write_bytes(b"theirs")

    with pytest.raises(FailedError, match="exchanged or removed"):
        write(tmp_path / "file", exchange, overwrite)
    (left,) = tmp_path.iterdir()
    assert left.name.endswith(PARTIAL_SUFFIX)
    assert left.read_bytes() == b"theirs"


def test_a_folder_that_was_renamed_keeps_no_temporary_file(tmp_path):
    (tmp_path / "before").mkdir()
    with pytest.raises(FailedError, match="was not written"):
        write(tmp_path / "before" / "file", lambda: (tmp_path / "before").rename(tmp_path / "after"))
    assert list((tmp_path / "after").iterdir()) == []


def test_a_folder_that_vanished_is_one_line(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(FailedError, match="was not written"):
        write(tmp_path / "folder" / "file", lambda: shutil.rmtree(tmp_path / "folder"))


def test_a_condition_that_does_not_hold_keeps_a_file_from_its_name(tmp_path, monkeypatch):
    def refuse():
        raise FailedError("not now")

    monkeypatch.setattr("deepmuon_runtime.files.publish.CONDITIONS", [*CONDITIONS, refuse])
    with pytest.raises(FailedError, match="not now"):
        write_whole(tmp_path / "file", b"all")
    assert list(tmp_path.iterdir()) == []


def test_no_descriptor_stays_open(tmp_path):
    program = """
        import os
        from deepmuon_runtime.files.whole import write_whole

        before = os.listdir("/proc/self/fd")
        for number in range(10):
            write_whole(f"file-{number}", b"all")
        assert os.listdir("/proc/self/fd") == before
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(program)], cwd=tmp_path, check=True)
