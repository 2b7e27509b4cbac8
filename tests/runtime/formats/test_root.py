"""ROOT files as uproot reads them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from deepmuon_runtime import Generator, Muons, RefusedError, check_file, read_muons
from deepmuon_runtime.formats.registry import opened_muons
from deepmuon_runtime.formats.root import BASKET, RootWriter

uproot = pytest.importorskip("uproot", reason="the extra `root` is not installed")


def test_the_tree_has_a_branch_for_each_column_and_a_text_says_what_is_known(tmp_path, model_file):
    generator = Generator.open(file=model_file, device="cpu")
    generator.write(tmp_path / "muons.root", 1000, seed=1)
    generator.write(tmp_path / "muons.h5", 1000, seed=1)
    muons = read_muons(tmp_path / "muons.h5")
    with uproot.open(tmp_path / "muons.root") as file:
        assert file.classnames(cycle=False) == {"muons": "TTree", "deepmuon": "TObjString"}
        tree = file["muons"]
        assert tree.typenames() == {**dict.fromkeys(["kinetic_energy", "u", "v", "w"], "float"), "pdg_id": "int32_t"}
        for name, values in muons.columns.items():
            np.testing.assert_array_equal(tree[name].array(library="np"), values)
        said = json.loads(str(file["deepmuon"]))
    assert (said["seed"], said["count"], said["depth_m"], said["rate_hz_per_m2"]) == (1, 1000, 10.0, 55.5)


def test_more_muons_than_one_basket_holds_are_all_there(tmp_path):
    n = BASKET // 4
    ones = np.ones(n, np.float32)
    numbers = np.arange(5 * n, dtype=np.float32) + 1
    with RootWriter(
        tmp_path / "muons.root", {"depth_m": 0.0, "medium": "air", "source": "x", "provenance": []}
    ) as root:
        for part in range(5):
            energy = numbers[part * n : (part + 1) * n] / 100
            root.append(Muons.of(energy, 0 * ones, 0 * ones, -ones, 13 * ones))
    assert check_file(tmp_path / "muons.root").defects == []
    with opened_muons(tmp_path / "muons.root") as source:
        found = np.concatenate([piece["kinetic_energy"] for piece in source.pieces()])
    np.testing.assert_array_equal(found, numbers / 100)


def test_a_tree_of_somebody_else_is_refused_with_the_way_to_read_it(tmp_path):
    with uproot.recreate(tmp_path / "other.root") as file:
        file["muons"] = {"energy": np.ones(3)}
    refused = pytest.raises(RefusedError, match=r"was not written by DeepMuon: .*deepmuon-train convert")
    with refused, opened_muons(tmp_path / "other.root"):
        pass


def test_a_changed_muon_is_a_defect(tmp_path, model_file):
    Generator.open(file=model_file, device="cpu").write(tmp_path / "muons.root", 1000, seed=1)
    energy = np.array(read_energies(tmp_path / "muons.root")[500], ">f4").tobytes()
    content = (tmp_path / "muons.root").read_bytes()
    assert content.count(energy) == 1
    (tmp_path / "muons.root").write_bytes(content.replace(energy, np.array(2.5, ">f4").tobytes()))
    (defect,) = check_file(tmp_path / "muons.root").defects
    assert "the column kinetic_energy is not what was written: its CRC-32 is " in defect


def read_energies(path):
    with uproot.open(path) as file:
        return file["muons/kinetic_energy"].array(library="np")
