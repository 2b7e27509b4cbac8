from __future__ import annotations

import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest

from deepmuon_runtime import Muons, write_muons

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-plot"
BEGINNING = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}


def write(path: Path, n: int, **known: float) -> None:
    random = np.random.default_rng(1)
    energy, w = random.exponential(4, n), -np.sqrt(random.random(n))
    muons = Muons.of(energy, np.sqrt(1 - w**2), np.zeros(n), w, np.full(n, 13))
    write_muons(path, muons, {"depth_m": 10.0, "medium": "G4_WATER", "source": "x", "provenance": [], **known})


@pytest.fixture
def plot(tmp_path):
    """Run the installed command in a folder with muon files: exit code, stdout, stderr."""
    write(tmp_path / "one.h5", 10_000, rate_hz_per_m2=50.0)
    write(tmp_path / "two.h5", 1)
    write(tmp_path / "none.h5", 0)

    def run(*arguments: str) -> tuple[int, str, str]:
        done = subprocess.run([COMMAND, *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=300)
        return done.returncode, done.stdout, done.stderr

    return run


@pytest.mark.parametrize("form", BEGINNING)
def test_files_become_a_picture(plot, tmp_path, form):
    pytest.importorskip("matplotlib")
    assert plot("one.h5", "two.h5", "-o", f"muons.{form}") == (0, "", "")
    assert (tmp_path / f"muons.{form}").read_bytes().startswith(BEGINNING[form])


def test_without_matplotlib_the_command_says_how_to_get_it(plot, tmp_path):
    program = "import sys; sys.modules['matplotlib'] = None; from deepmuon_cli.plot import main; main()"
    words = [sys.executable, "-c", program, "one.h5", "-o", "muons.png"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "deepmuon-plot: a picture needs matplotlib: pip install 'deepmuon-runtime[plot]'\n"
    assert not (tmp_path / "muons.png").exists()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["missing.h5", "-o", "muons.png"], "missing.h5 can't be read"),
        (["one.h5", "none.h5", "-o", "muons.png"], "none.h5 holds no muon"),
        (["one.h5", "-o", "muons.gif"], "should end with .png, .pdf or .svg"),
        (["one.h5"], "Missing option '-o'"),
        (["-o", "muons.png"], "Missing argument 'FILES...'"),
    ],
)
def test_what_can_t_be_drawn_is_refused(plot, tmp_path, arguments, reason):
    code, out, err = plot(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("deepmuon-plot: ")
    assert err.count("\n") == 1
    assert reason in err
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".h5"] * 3


def test_an_existing_picture_is_replaced_only_where_asked(plot, tmp_path):
    pytest.importorskip("matplotlib")
    (tmp_path / "muons.png").write_text("precious")
    assert plot("one.h5", "-o", "muons.png")[0] == 2
    assert (tmp_path / "muons.png").read_text() == "precious"
    assert plot("one.h5", "-o", "muons.png", "--overwrite") == (0, "", "")
