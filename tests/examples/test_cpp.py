"""The C++ examples and the programs of the guide, built with OpenVINO as their pages say and run."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import onnx
import pytest
from support.analytic_family import MEAN_COS, MEAN_SIN, SPHERE_RATE, analytic_family
from support.engines import MODELS as RELEASED
from support.tiny_families import tiny_family

from deepmuon_runtime import Box, Generator, read_muons
from deepmuon_runtime.model.baking import bake

REPOSITORY = Path(__file__).parents[2]
MODELS = REPOSITORY / "models" / "deepmuon_models"
README = REPOSITORY / "examples" / "cpp" / "README.md"
EMBEDDING = REPOSITORY / "docs" / "embedding.md"

needs_openvino = pytest.mark.skipif(
    not (find_spec("openvino") and shutil.which("cmake") and shutil.which("c++"))
    and "openvino" not in os.environ.get("DEEPMUON_ENGINES", ""),
    reason="OpenVINO's Python package, CMake and a C++ compiler are not all there",
)


def blocks(page: Path, language: str) -> list[str]:
    """Return the code of a page's blocks in a language, those in lists included."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    return [re.sub(f"^{indent}", "", code, flags=re.MULTILINE) for indent, code in found]


def shell(code: str, folder: Path) -> str:
    """Run shell commands with this Python and without installing anything."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = ["bash", "-c", f"set -e; pip() {{ :; }}\n{code}"]
    done = subprocess.run(command, cwd=folder, env={**os.environ, "PATH": path}, stdout=subprocess.PIPE, text=True)
    print(done.stdout)
    assert done.returncode == 0
    return done.stdout


@pytest.fixture(scope="module")
def readme(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder where the README's commands ran, and what they wrote."""
    folder = tmp_path_factory.mktemp("cpp")
    for part in ("examples", "models", "tests"):
        (folder / part).symlink_to(REPOSITORY / part)
    (code,) = blocks(README, "sh")
    return folder, shell(code, folder)


@needs_openvino
def test_every_released_model_gives_its_test_vectors(readme: tuple[Path, str]):
    _, written = readme
    for model in RELEASED:
        assert re.search(rf"{model.name}: \d+ muons, energy \S+, direction \S+, charges 0$", written, re.MULTILINE)
    assert "100% tests passed" in written


@needs_openvino
def test_other_muons_are_seen(readme: tuple[Path, str], tmp_path: Path):
    folder, _ = readme
    vectors = (REPOSITORY / "tests" / "vectors" / "quantile-0m.json").read_text("utf-8")
    wrong = tmp_path / "wrong.json"
    wrong.write_text(
        vectors.replace('"charge": [1', '"charge": [-1')
        if '"charge": [1' in vectors
        else vectors.replace('"charge": [-1', '"charge": [1')
    )
    program = folder / "build" / "cpp" / "compare-vectors"
    assert subprocess.run([program, MODELS / "quantile-0m.onnx", wrong]).returncode == 1
    right_vectors_of_another = REPOSITORY / "tests" / "vectors" / "quantile-10m.json"
    assert subprocess.run([program, MODELS / "quantile-0m.onnx", right_vectors_of_another]).returncode == 1


def sampled(folder: Path, model: str | Path, count: int, seed: int) -> np.ndarray:
    command = [folder / "build" / "cpp" / "deepmuon-sample", MODELS / model, str(count), str(seed)]
    written = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    header, *rows = csv.reader(written.splitlines())
    assert header == ["kinetic_energy", "u", "v", "w", "pdg_id"]
    return np.array(rows, dtype=float)


@needs_openvino
@pytest.mark.parametrize("model", ["quantile-10m.onnx", "transformer-10m.onnx"])
def test_muons_by_seed_are_those_of_the_model(readme: tuple[Path, str], model: str):
    folder, _ = readme
    muons = sampled(folder, model, 50_000, 1)
    assert len(muons) == 50_000
    assert np.median(muons[:, 0]) == pytest.approx(3.14, rel=0.05)  # held-out muons: 3.142 GeV
    np.testing.assert_allclose(np.linalg.norm(muons[:, 1:4], axis=1), 1, atol=1e-6)
    assert np.all(muons[:, 3] < 0)
    assert set(muons[:, 4]) == {-13, 13}
    np.testing.assert_array_equal(sampled(folder, model, 1000, 1)[:128], muons[:128])
    assert not np.any(sampled(folder, model, 1000, 2)[:, 0] == muons[:1000, 0])


@needs_openvino
@pytest.mark.parametrize("model", ["quantile-10m.onnx", "transformer-0m.onnx"])
@pytest.mark.parametrize("metadata", [{}, {"flux": "measured", "depth_m": "0.1"}, {"created_by": "Ein Programm 2.0"}])
def test_a_seed_gives_the_muons_of_deepmuon_gen(readme: tuple[Path, str], tmp_path: Path, model: str, metadata: dict):
    folder, _ = readme
    content = onnx.load(MODELS / model)
    texts = {entry.key: entry.value for entry in content.metadata_props}
    texts |= {f"deepmuon.{key}": value for key, value in metadata.items()}
    onnx.helper.set_model_props(content, texts)
    path = tmp_path / "model.onnx"
    onnx.save(content, path)
    seed, count = 2**64 - 1, 20_000
    gen = [sys.executable, "-m", "deepmuon_cli.gen", "--model", path, "-n", str(count), "--seed", str(seed), "-q"]
    subprocess.run([*gen, "-o", tmp_path / "muons.h5"], check=True)
    found, expected = sampled(folder, path, count, seed), read_muons(tmp_path / "muons.h5")
    # A transformer's energies are those of its many sums in float32; a charge at its threshold is rounding's.
    np.testing.assert_allclose(found[:, 0], expected.kinetic_energy, rtol=1e-4)
    np.testing.assert_allclose(found[:, 1:4], np.transpose([expected.u, expected.v, expected.w]), atol=1e-5)
    assert np.sum(found[:, 4] != expected.pdg_id) <= 2


def run_sample(folder: Path, *words: object) -> subprocess.CompletedProcess[str]:
    program = folder / "build" / "cpp" / "deepmuon-sample"
    return subprocess.run([program, *map(str, words)], capture_output=True, text=True)


def muons_of(written: str) -> np.ndarray:
    return np.array(list(csv.reader(written.splitlines()))[1:], dtype=float)


@needs_openvino
@pytest.mark.parametrize("raw", [True, False])
@pytest.mark.parametrize("depth", [0, 0.1, 13.7, 100])
def test_a_family_at_a_depth_gives_the_muons_of_python(readme: tuple[Path, str], tmp_path: Path, depth, raw):
    family, baked, sphere = (tmp_path / f"{name}.onnx" for name in ("family", "baked", "sphere"))
    family.write_bytes(tiny_family(raw=raw))
    baked.write_bytes(bake(family.read_bytes(), depth))
    sphere.write_bytes(bake(family.read_bytes(), depth, 1))
    for words, generator in (
        ([family, 1000, 7, depth], Generator.open(depth, file=family)),
        ([baked, 1000, 7], Generator.open(depth, file=family)),
        ([family, 1000, 7], Generator.open(file=family)),
        ([sphere, 1000, 7], Generator.open(file=sphere)),
    ):
        done = run_sample(readme[0], *words)
        assert f"quantile, {generator.model.depth_m:g} m of water" in done.stderr
        found, expected = muons_of(done.stdout), generator.sample(1000, seed=7)
        np.testing.assert_allclose(found[:, 0], expected.kinetic_energy, rtol=2e-5)
        np.testing.assert_allclose(found[:, 1:4], np.transpose([expected.u, expected.v, expected.w]), atol=2e-6)
        np.testing.assert_array_equal(found[:, 4], expected.pdg_id)


@needs_openvino
@pytest.mark.parametrize(
    ("depth", "message"),
    [
        ("100.1", "has depths from 0 to 100 m, and not 100.1"),
        ("-1", "has depths from 0 to 100 m, and not -1"),
        ("deep", "deep is no number of metres"),
    ],
)
def test_a_depth_that_a_family_has_not_is_told(readme: tuple[Path, str], family_file: Path, depth: str, message: str):
    done = run_sample(readme[0], family_file, 10, 1, depth)
    assert (done.returncode, done.stdout) == (1, "")
    assert message in done.stderr


@needs_openvino
def test_a_model_of_one_depth_takes_none(readme: tuple[Path, str]):
    done = run_sample(readme[0], MODELS / "quantile-0m.onnx", 10, 1, 10)
    assert (done.returncode, done.stdout) == (1, "")
    assert "no family: there is no depth to be set" in done.stderr


@needs_openvino
def test_the_rate_of_a_family_goes_with_its_depth(readme: tuple[Path, str], tmp_path: Path, family_file: Path):
    (tmp_path / "rate.cpp").write_text(
        """#include <iostream>
        #include "deepmuon.hpp"
        int main(int, char** words) {
            std::cout << deepmuon::Generator(words[1], 13.7f).metadata("rate_hz_per_m2") << " "
                      << deepmuon::Generator(words[1]).metadata("rate_hz_per_m2") << "\\n";
        }"""
    )
    (tmp_path / "CMakeLists.txt").write_text(
        f"""cmake_minimum_required(VERSION 3.21)
        project(rate CXX)
        add_subdirectory({REPOSITORY / "examples" / "cpp"} deepmuon)
        add_executable(rate rate.cpp)
        target_link_libraries(rate PRIVATE deepmuon)"""
    )
    _, build = blocks(EMBEDDING, "sh")
    shell(build[build.index("cmake -B") : build.index("build/my-muons")], tmp_path)
    found = subprocess.run([tmp_path / "build" / "rate", family_file], stdout=subprocess.PIPE, text=True, check=True)
    assert [float(word) for word in found.stdout.split()] == pytest.approx([82.6, 90], rel=1e-5)


@needs_openvino
def test_muons_enter_a_box_as_often_and_where_they_should(tmp_path: Path):
    (tmp_path / "family.onnx").write_bytes(analytic_family())
    sphere = onnx.load_model_from_string(analytic_family({"surface": "1"}))
    (surface,) = (tensor for tensor in sphere.graph.initializer if tensor.name == "surface")
    surface.CopyFrom(onnx.numpy_helper.from_array(np.int32(1), "surface"))
    onnx.save(sphere, tmp_path / "sphere.onnx")
    (tmp_path / "enter.cpp").write_text(
        """#include <cstdio>
        #include "box.hpp"
        #include "deepmuon.hpp"
        int main(int, char** words) {
            deepmuon::Generator generator(words[1]);
            const deepmuon::Box box(0.4, 0.2, 0.3);
            auto latents = generator.random(1), numbers = generator.random(2);
            for (const auto& muon : generator.sample(200000, latents)) {
                if (const auto entry = box.enter(muon, [&] { return numbers() * 0x1p-32; })) {
                    std::printf("%.9g,%.9g,%.9g,", entry->x, entry->y, entry->z);
                    std::printf("%.9g,%.9g,%.9g\\n", muon.u, muon.v, muon.w);
                }
            }
            std::printf("%.9g,0,0,0,0,0\\n", box.largest_area());
        }"""
    )
    (tmp_path / "CMakeLists.txt").write_text(
        f"""cmake_minimum_required(VERSION 3.21)
        project(enter CXX)
        add_subdirectory({REPOSITORY / "examples" / "cpp"} deepmuon)
        add_executable(enter enter.cpp)
        target_link_libraries(enter PRIVATE deepmuon)"""
    )
    _, build = blocks(EMBEDDING, "sh")
    shell(build[build.index("cmake -B") : build.index("build/my-muons")], tmp_path)
    command = [tmp_path / "build" / "enter", tmp_path / "sphere.onnx"]
    written = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    rows = np.array([line.split(",") for line in written.splitlines()], dtype=float)
    (x, y, z, u, v, w), largest = rows[:-1].T, rows[-1, 0]
    assert Box(0.4, 0.2, 0.3).touches(x, y, z, u, v, w).all()
    across = MEAN_SIN * 2 / np.pi
    areas = {"top": 0.08 * MEAN_COS, "x": 0.06 * across, "y": 0.12 * across}
    # Binomial numbers of 200,000 tries, five standard deviations: a false alarm in a million runs.
    counts = {"top": np.sum(z == 0.15), "x": np.sum(np.abs(x) == 0.2), "y": np.sum(np.abs(y) == 0.1)}
    for face, area in areas.items():
        share = area / largest
        assert abs(counts[face] - 200_000 * share) < 5 * np.sqrt(200_000 * share * (1 - share))
    rate = Generator.open(file=tmp_path / "family.onnx").rate(target=Box(0.4, 0.2, 0.3))
    assert rate is not None
    assert rate.hz == pytest.approx(SPHERE_RATE * sum(areas.values()), rel=1e-3)


@needs_openvino
def test_the_readme_shows_what_its_last_command_writes(readme: tuple[Path, str]):
    _, written = readme
    shown = np.array([row.split(",") for row in blocks(README, "text")[0].splitlines()[1:]], dtype=float)
    found = np.array([row.split(",") for row in written.splitlines()[-len(shown) :]], dtype=float)
    np.testing.assert_allclose(found, shown, rtol=2e-5, atol=2e-6)


@needs_openvino
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{model}", "1e3", "1"], "1e3 is no whole number"),
        (["{model}", "-1", "1"], "-1 is no whole number"),
        (["nothing.onnx", "1", "1"], "nothing.onnx"),
        (["{foreign}", "1", "1"], "does not say its deepmuon.contract_version"),
    ],
)
def test_what_is_wrong_is_said(readme: tuple[Path, str], tmp_path: Path, arguments: list[str], message: str):
    foreign = onnx.load(MODELS / "quantile-0m.onnx")
    del foreign.metadata_props[:]
    onnx.save(foreign, tmp_path / "foreign.onnx")
    names = {"model": MODELS / "quantile-0m.onnx", "foreign": tmp_path / "foreign.onnx"}
    command = [readme[0] / "build" / "cpp" / "deepmuon-sample", *(argument.format(**names) for argument in arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert message in done.stderr
    assert done.stdout == ""


@needs_openvino
def test_the_guides_program_builds_and_runs(tmp_path: Path):
    shutil.copytree(REPOSITORY / "examples" / "cpp", tmp_path / "deepmuon")
    (program,), (project,) = blocks(EMBEDDING, "cpp"), blocks(EMBEDDING, "cmake")
    (tmp_path / "main.cpp").write_text(program)
    (tmp_path / "CMakeLists.txt").write_text(project)
    where, build = blocks(EMBEDDING, "sh")
    assert (Path(shell(where, tmp_path).strip()) / "quantile-10m.onnx").exists()
    last_line = shell(build, tmp_path).splitlines()[-1]
    assert re.fullmatch(r"mean energy [78]\.\d+ GeV at 10 m, 55\.\d+ muons per second and m2", last_line)


@pytest.mark.skipif(
    not (REPOSITORY / "tests" / "engines" / "node_modules").exists()
    and "onnxruntime-node" not in os.environ.get("DEEPMUON_ENGINES", ""),
    reason="onnxruntime-node is not installed: `npm ci` in tests/engines does that",
)
def test_the_guides_javascript_runs(tmp_path: Path):
    (tmp_path / "node_modules").symlink_to(REPOSITORY / "tests" / "engines" / "node_modules")
    shutil.copyfile(MODELS / "quantile-10m.onnx", tmp_path / "quantile-10m.onnx")
    (code,) = blocks(EMBEDDING, "js")
    (tmp_path / "muons.mjs").write_text(code)
    done = subprocess.run(["node", "muons.mjs"], cwd=tmp_path, stdout=subprocess.PIPE, check=True, text=True)
    assert re.match(r"\d+\.\d+ Float32Array\(3\) \[", done.stdout)
