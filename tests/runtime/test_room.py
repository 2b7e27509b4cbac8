from __future__ import annotations

import os
import shutil
from types import SimpleNamespace

import pytest

from deepmuon_runtime import Generator, RefusedError, convert_file, merge_shards
from deepmuon_runtime.room import check_memory


@pytest.fixture
def full_disk(tmp_path, model_file, monkeypatch):
    """A folder with a muon file, on a disk with no room for another."""
    Generator.open(file=model_file).write(tmp_path / "muons.h5", 1000, seed=1)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=10_000))
    return tmp_path


def test_more_muons_than_the_disk_holds_are_refused_before_any_is_made(full_disk, model_file):
    with pytest.raises(RefusedError, match=r"1,000 muons need 17 kB, and .* has 10 kB free"):
        Generator.open(file=model_file).write(full_disk / "more.h5", 1000)
    assert not (full_disk / "more.h5").exists()


def test_a_merge_that_the_disk_does_not_hold_is_refused_and_a_virtual_one_fits(full_disk):
    with pytest.raises(RefusedError, match=r"1,000 muons need 17 kB, and .* has 10 kB free"):
        merge_shards([full_disk / "muons.h5"], full_disk / "all.h5")
    assert merge_shards([full_disk / "muons.h5"], full_disk / "all.h5", virtual=True) == 1000


def test_text_that_the_disk_can_not_hold_is_refused(full_disk):
    with pytest.raises(RefusedError, match=r"1,000 muons need 12 kB, and .* has 10 kB free"):
        convert_file(full_disk / "muons.h5", full_disk / "muons.csv")
    assert not (full_disk / "muons.csv").exists()


def test_a_system_that_does_not_tell_its_memory_is_believed_to_have_enough(monkeypatch):
    with pytest.raises(RefusedError, match=r"all do not fit in the .* of memory: take fewer"):
        check_memory(1 << 60, "all", "take fewer")
    monkeypatch.delattr(os, "sysconf")
    check_memory(1 << 60, "all", "take fewer")
