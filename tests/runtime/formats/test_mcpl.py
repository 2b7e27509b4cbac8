"""MCPL as its own programs read it."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

from deepmuon_runtime import Generator, RefusedError, Shard, read_muons
from deepmuon_runtime.formats.registry import opened_muons, output_format

mcpl = pytest.importorskip("mcpl", reason="the extra `mcpl` is not installed")

N = 2000
HEADING = 5  # lines of mcpltool's text
LIVE = {"target": "box", "target_rate_hz": 40.0}
ABOUT = {"depth_m": 10.0, "medium": "G4_WATER", "rate_hz_per_m2": 50.0, "seed": 7, "source": "a test", "provenance": []}


def muons_all_over_the_sky() -> dict[str, np.ndarray]:
    """Columns of muons of which each component of the direction is the largest of a few hundred."""
    random = np.random.default_rng(3)
    w = -random.uniform(1e-3, 1, N)
    azimuth = random.uniform(0, 2 * np.pi, N)
    sine = np.sqrt(1 - w**2)
    columns = {
        "kinetic_energy": random.lognormal(1, 2, N).astype("f4"),
        "u": (sine * np.cos(azimuth)).astype("f4"),
        "v": (sine * np.sin(azimuth)).astype("f4"),
        "w": w.astype("f4"),
        "pdg_id": random.choice([13, -13], N).astype("i1"),
        **{name: random.uniform(-2, 2, N).astype("f4") for name in "xyz"},
        "time": np.sort(random.uniform(0, 86400, N)),
    }
    largest = np.argmax(np.abs([columns[name] for name in "uvw"]), axis=0)
    assert np.bincount(largest).min() > 100
    return columns


def write(path, optional, **more):
    columns = muons_all_over_the_sky()
    for name in {"x", "y", "z", "time"} - set(optional):
        del columns[name]
    with output_format(path).writer(path, {**ABOUT, **more}, optional=optional) as writer:
        for first in (0, 700, 1400):
            writer.append_columns({name: values[first : min(first + 700, N)] for name, values in columns.items()})
    return columns


def blocks(file) -> dict[str, np.ndarray]:
    names = ("ekin", "ux", "uy", "uz", "pdgcode", "x", "y", "z", "time", "weight")
    pieces = [{name: np.array(getattr(block, name)) for name in names} for block in file.particle_blocks]
    return {
        name: np.concatenate([np.broadcast_to(part[name], part["ekin"].shape) for part in pieces]) for name in names
    }


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # mcpl leaves packed files open
@pytest.mark.parametrize("name", ["muons.mcpl", "muons.mcpl.gz"])
@pytest.mark.parametrize("optional", [(), ("x", "y", "z"), ("x", "y", "z", "time")], ids=["none", "place", "time"])
def test_the_package_mcpl_reads_the_same_muons_in_its_units(tmp_path, name, optional):
    columns = write(tmp_path / name, optional)
    file = mcpl.MCPLFile(str(tmp_path / name))
    assert (file.version, file.sourcename, file.nparticles) == (3, "DeepMuon", N)
    assert file.opt_singleprec == ("time" not in optional)
    found = blocks(file)
    np.testing.assert_allclose(found["ekin"], 1e3 * columns["kinetic_energy"].astype(float), rtol=1e-7)
    np.testing.assert_allclose([found["ux"], found["uy"], found["uz"]], [columns[k] for k in "uvw"], atol=2e-6)
    np.testing.assert_allclose(found["ux"] ** 2 + found["uy"] ** 2 + found["uz"] ** 2, 1, atol=1e-12)
    np.testing.assert_array_equal(found["pdgcode"], columns["pdg_id"])
    assert set(found["weight"]) == {1.0}
    for axis in "xyz":
        place = 100 * columns[axis].astype(float) if optional else 0
        np.testing.assert_allclose(found[axis], np.broadcast_to(place, N), rtol=1e-7)
    if "time" in optional:
        np.testing.assert_allclose(found["time"], 1e3 * columns["time"], rtol=1e-15)
    else:
        assert set(found["time"]) == {0.0}


def test_the_header_says_what_is_known_and_its_statistics_the_live_time(tmp_path):
    write(tmp_path / "muons.mcpl", ("x", "y", "z"), **LIVE)
    file = mcpl.MCPLFile(str(tmp_path / "muons.mcpl"))
    for line in ("depth_m = 10.0", 'medium = "G4_WATER"', "rate_hz_per_m2 = 50.0", "seed = 7", 'target = "box"'):
        assert line in file.comments
    assert dict(file.stat_sum) == {"deepmuon_live_time_s": N / 40.0, "deepmuon_live_time_s_m2": N / 50.0}


def test_without_a_rate_there_is_no_live_time(tmp_path):
    with output_format("muons.mcpl").writer(tmp_path / "muons.mcpl", {"depth_m": 1.0, "medium": "rock"}):
        pass
    file = mcpl.MCPLFile(str(tmp_path / "muons.mcpl"))
    assert (file.nparticles, dict(file.stat_sum)) == (0, {})


@pytest.mark.parametrize("program", ["mcpltool", "pymcpltool"])
@pytest.mark.parametrize("name", ["muons.mcpl", "muons.mcpl.gz"])
def test_mcpltool_lists_the_muons(tmp_path, program, name):
    columns = write(tmp_path / name, ("x", "y", "z", "time"))
    found = shutil.which(program) or pytest.skip(f"there is no {program}")
    done = subprocess.run([found, "--text", name, "muons.txt"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    rows = np.loadtxt(tmp_path / "muons.txt", skiprows=HEADING, usecols=range(12))
    np.testing.assert_array_equal(rows[:, 1], columns["pdg_id"])
    np.testing.assert_allclose(rows[:, 2], 1e3 * columns["kinetic_energy"].astype(float), rtol=1e-9)
    np.testing.assert_allclose(rows[:, 9], 1e3 * columns["time"], rtol=1e-9)


def test_shards_are_joined_by_mcpltool_which_adds_their_live_times(tmp_path, model_file):
    """By force: what the shards say of themselves is not the same, and is left out."""
    generator = Generator.open(file=model_file, device="cpu")
    generator.write(tmp_path / "all.h5", 3000, seed=1)
    muons = read_muons(tmp_path / "all.h5")
    for part in (1, 2):
        generator.write(tmp_path / f"{part}.mcpl", 3000, seed=1, shard=Shard(part, 2))
    tool = shutil.which("mcpltool") or pytest.skip("there is no mcpltool")
    words = [tool, "--forcemerge", "both.mcpl", "1.mcpl", "2.mcpl"]
    assert subprocess.run(words, cwd=tmp_path, capture_output=True).returncode == 0
    found = blocks(mcpl.MCPLFile(str(tmp_path / "both.mcpl")))
    np.testing.assert_array_equal(found["pdgcode"], muons.pdg_id)
    np.testing.assert_allclose(found["ekin"], 1e3 * muons.kinetic_energy.astype(float), rtol=1e-6)


def test_a_file_that_another_program_changed_or_made_is_refused(tmp_path):
    write(tmp_path / "muons.mcpl", ())
    tool = shutil.which("mcpltool") or pytest.skip("there is no mcpltool")
    assert subprocess.run([tool, "--extract", "-l10", "muons.mcpl", "few.mcpl"], cwd=tmp_path).returncode == 0
    with pytest.raises(RefusedError, match=r"few\.mcpl") as refusal, opened_muons(tmp_path / "few.mcpl"):
        pass
    assert "\n" not in str(refusal.value)
