"""Damaged models and shards by the hundred: none ends a command by a signal, hangs it, or writes beside its output."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.commands import endings
from support.damage import DAMAGES, cut_out, overwrite, repeat, truncate
from support.thorough import TIMES
from support.tiny_families import tiny_family
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, Shard, check_file, list_models
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX
from deepmuon_runtime.model.released import read_released

pytestmark = pytest.mark.campaign

SEED = 4


def damaged_models(folder: Path, count: int, seed: int = SEED) -> list[Path]:
    """Write damaged models, each in a folder of its own."""
    random = np.random.default_rng(seed)
    released = [read_released(model) for model in list_models() if model.depth_m == 0]
    whole = [tiny_model(), tiny_model(8), tiny_family(), *released]
    paths = []
    for number in range(count):
        content = DAMAGES[number % len(DAMAGES)](whole[random.integers(len(whole))], random)
        paths.append(folder / str(number) / "model.onnx")
        paths[-1].parent.mkdir()
        paths[-1].write_bytes(content)
    return paths


def models_ran(folder: Path, count: int, seed: int = SEED) -> Counter[int]:
    """Run damaged models, look at what each left, and count the exit codes."""
    paths = damaged_models(folder, count, seed)
    before = set(folder.rglob("*"))
    codes = endings(
        "gen",
        [
            ["--model", f"{path}", "-n", "20000", "--seed", "1", "--threads", "1", "-o", f"{path.parent / 'muons.h5'}"]
            for path in paths
        ],
    )
    outputs = {path.parent / "muons.h5" for path, code in zip(paths, codes, strict=True) if code == 0}
    assert set(folder.rglob("*")) - before == outputs
    assert [path for path in outputs if check_file(path).defects] == []
    return Counter(codes)


def test_no_damaged_model_ends_the_command_by_a_signal_or_leaves_anything_but_good_muons(tmp_path):
    """280 models."""
    found = models_ran(tmp_path, 280 * TIMES)
    assert found.keys() <= {0, 1, 2}
    assert found[0] > 0
    assert found[2] > 100


DAMAGE_OF_BYTES: tuple[Callable[..., bytes], ...] = (overwrite, truncate, cut_out, repeat)


@pytest.mark.parametrize("options", [[], ["--virtual"]], ids=["copied", "virtual"])
def test_no_damaged_shard_ends_the_merge_by_a_signal_or_leaves_anything_but_good_muons(tmp_path, model_file, options):
    """100 shards."""
    generator = Generator.open(file=model_file)
    for number in (1, 2):
        generator.write(tmp_path / f"{number}.h5", 2000, seed=1, shard=Shard(number, 2))
    content = (tmp_path / "2.h5").read_bytes()
    random = np.random.default_rng(SEED)
    lines = []
    for number in range(100 * TIMES):
        (tmp_path / f"damaged-{number}.h5").write_bytes(DAMAGE_OF_BYTES[number % 4](content, random))
        shards = [f"{tmp_path}/1.h5", f"{tmp_path}/damaged-{number}.h5"]
        lines.append([*options, *shards, "-o", f"{tmp_path}/out-{number}.h5"])
    before = set(tmp_path.iterdir())
    codes = endings("merge", lines)
    assert set(codes) <= {0, 2}
    outputs = {tmp_path / f"out-{number}.h5" for number, code in enumerate(codes) if code == 0}
    left = {path for path in set(tmp_path.iterdir()) - before if path.suffix != PARTIAL_SUFFIX}  # where HDF5 crashed
    assert left == outputs
    assert [path for path in outputs if check_file(path).defects] == []
