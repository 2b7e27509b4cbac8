"""The code of the page on detectors, of a small family in place of the released one."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.analytic_family import analytic_family

from deepmuon_runtime import Generator, read_muons

PAGE = (Path(__file__).parents[2] / "docs" / "detectors.md").read_text("utf-8")


def blocks(*languages: str) -> list[str]:
    return re.findall(rf"^```(?:{'|'.join(languages)})\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.fixture
def family(tmp_path: Path) -> Path:
    path = tmp_path / "family.onnx"
    path.write_bytes(analytic_family())
    return path


def test_the_python_of_the_page_runs_from_top_to_bottom(family: Path, monkeypatch, capsys) -> None:
    opened = Generator.open
    monkeypatch.setattr(Generator, "open", lambda depth: opened(depth, file=family))
    names: dict[str, object] = {}
    for code in blocks("py", "python"):
        exec(compile(code, "detectors.md", "exec"), names)
    assert len(capsys.readouterr().out.splitlines()) == 7


def test_the_table_for_wcsim_has_its_columns_in_its_units(family: Path, tmp_path: Path) -> None:
    (code,) = blocks("console")
    code = code.replace("$ ", "", 1).replace("\n$ ", "\n").replace("--depth 10", f"--depth 10 --model {family}")
    code = code.replace("deepmuon-gen", f"{sys.executable} -m deepmuon_cli.gen").replace(
        "deepmuon-convert", f"{sys.executable} -m deepmuon_cli.convert"
    )
    subprocess.run(["bash", "-c", f"set -e -o pipefail\n{code}"], cwd=tmp_path, check=True, capture_output=True)
    muons, table = read_muons(tmp_path / "muons.h5"), np.loadtxt(tmp_path / "muons.txt")
    places = [1000 * muons.columns[axis].astype(float) for axis in "xyz"]
    none = np.zeros(len(muons))
    wanted = [none, muons.pdg_id, 1000.0 * muons.kinetic_energy, *places, muons.u, muons.v, muons.w, none]
    np.testing.assert_allclose(table, np.stack(wanted, axis=1), rtol=2e-7)
