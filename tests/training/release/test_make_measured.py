from __future__ import annotations

import sys
from pathlib import Path

from deepmuon_runtime import read_attributes
from deepmuon_runtime.muon_file.check import check_file
from deepmuon_training.pipeline.step import run_steps

sys.path.insert(0, str(Path(__file__).parents[3] / "models"))
from make_measured import sample_steps
from measured_plan import PLAN, Deep


def test_the_samples_of_a_family_are_made_in_steps_that_are_not_repeated(tmp_path, monkeypatch):
    plan = (Deep("training-0m", "rock", 0.0, 5000, 1), Deep("training-400m", "rock", 400.0, 5000, 2))
    monkeypatch.setitem(PLAN, "rock", plan)
    (tmp_path / "samples").mkdir()
    said: list[str] = []
    run_steps(list(sample_steps(tmp_path, "rock")), said.append, progress=False)
    for deep in plan:
        path = tmp_path / "samples" / f"{deep.name}.h5"
        assert check_file(path).defects == []
        known = read_attributes(path)
        assert (known["count"], known["depth_m"], known["flux"]) == (5000, deep.depth_m, "measured")
    assert sorted(path.name for path in (tmp_path / "samples").iterdir()) == [
        "SHA256SUMS",
        "training-0m.h5",
        "training-400m.h5",
    ]
    said.clear()
    run_steps(list(sample_steps(tmp_path, "rock")), said.append, progress=False)
    assert not any("made in" in line for line in said)
