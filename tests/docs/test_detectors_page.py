"""The page on detectors: the table that it makes for WCSim, and the numbers that it has from a study.

Its code, and what that prints, is run with that of all pages.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from deepmuon_runtime import Generator, read_muons
from studies.pictures.targets import SCENES, Scene

REPOSITORY = Path(__file__).parents[2]
PAGE = (REPOSITORY / "docs" / "detectors.md").read_text("utf-8")
STUDY = json.loads((REPOSITORY / "studies" / "pictures" / "targets.json").read_text("utf-8"))


def test_the_table_for_wcsim_has_its_columns_in_its_units_and_a_line_for_each_event(tmp_path: Path) -> None:
    (code,) = re.findall(r"^```bash\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = ["bash", "-c", f"set -e -o pipefail\n{code}"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, env={**os.environ, "PATH": path})
    muons, table = read_muons(tmp_path / "muons.h5"), np.loadtxt(tmp_path / "muons.txt")
    places = [1000 * muons.columns[axis].astype(float) for axis in "xyz"]
    none = np.zeros(len(muons))
    wanted = [none, muons.pdg_id, 1000.0 * muons.kinetic_energy, *places, muons.u, muons.v, muons.w, none]
    np.testing.assert_allclose(table, np.stack(wanted, axis=1), rtol=2e-7)
    assert f"/run/beamOn {len(muons)}\n" in PAGE


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_rates_of_the_study_are_those_of_the_released_family(scene: Scene) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of tall targets that their top sees more
        rate = Generator.open(scene.depth).rate(target=scene.target, cuts=scene.cuts)
    assert rate is not None
    assert STUDY[scene.name]["rate_hz"] == pytest.approx(rate.hz, rel=1e-4)  # one in the last of five digits
    # The analytic numbers are those of 4 million muons, to 0.2 % where flat ones alone count.
    count, analytic = STUDY[scene.name]["all"]
    assert rate.hz == pytest.approx(analytic, rel=3e-3)
    assert count == pytest.approx(analytic * scene.live_time, abs=5 * count**0.5)


def test_numbers_by_hand_are_those_of_the_study() -> None:
    def by_hand(name: str, face: str = "all") -> float:
        return STUDY[name][face][1]

    top, sides, tank = (by_hand("tank", face) for face in ("top", "sides", "all"))
    panel, edges, upright = by_hand("panel"), by_hand("panel", "sides"), by_hand("panel, upright")
    hard = by_hand("panel, above 1 GeV")
    text = " ".join(PAGE.split())
    for words in (
        f"{top:.1f} and {sides:.1f} in the table, together {tank:.1f}.",
        f"{top:.1f} / {tank:.1f} = {top / tank:.0%}".replace("%", " %"),
        f"{panel:.2f}, {edges:.2f} of it by the edges; {upright:.2f} upright, and {hard:.2f} above 1 GeV",
        f"{by_hand('wall'):.2f} of {by_hand('wall, all angles'):.2f}, "
        f"{by_hand('wall') / by_hand('wall, all angles'):.0%}".replace("%", " %"),
    ):
        assert words in text
