from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.tiny_families import tiny_families, tiny_family
from support.tiny_models import release, tiny_model

# Some tests are about signals that they and all their children would ignore when started in the background of
# a shell (Ctrl-C) or by nohup (SIGHUP).
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    """A model that keeps the contract, one muon a draw."""
    path = tmp_path / "tiny.onnx"
    path.write_bytes(tiny_model())
    return path


@pytest.fixture
def family_file(tmp_path: Path) -> Path:
    """A family of any depth from 0 to 100 m."""
    path = tmp_path / "family.onnx"
    path.write_bytes(tiny_family())
    return path


@pytest.fixture
def released(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on Python's path with a package of small released models, in place of the real one."""
    yield from _in_place_of_the_released(tmp_path / "released", monkeypatch, {})


@pytest.fixture
def released_families(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The same with three families among them: the first has the depths of the quantile models of one depth too."""
    yield from _in_place_of_the_released(tmp_path / "released", monkeypatch, tiny_families())


def _in_place_of_the_released(folder: Path, monkeypatch: pytest.MonkeyPatch, more: dict[str, bytes]) -> Iterator[Path]:
    of_cry = {"flux": "cry", "medium": "water"}
    release(
        folder,
        {
            "quantile-0m.onnx": tiny_model(metadata={**of_cry, "depth_m": "0.0", "rate_hz_per_m2": "110.0"}),
            "quantile-10m.onnx": tiny_model(metadata=of_cry),
            "transformer-10m.onnx": tiny_model(8, {**of_cry, "architecture": "transformer"}),
            **more,
        },
    )
    monkeypatch.delitem(sys.modules, "deepmuon_models", raising=False)
    monkeypatch.syspath_prepend(folder)
    yield folder
    sys.modules.pop("deepmuon_models", None)  # whoever comes next shall find the real one
