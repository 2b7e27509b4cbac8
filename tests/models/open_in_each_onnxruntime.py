"""Runs every released model in the oldest ONNX Runtime of each promise and in each minor release up to the newest.

The ONNX contract promises that ONNX Runtime 1.17 reads the files; deepmuon-runtime declares in pyproject.toml which
one it needs, and that one is tried as it stands there. From it on the package samples each model too. All releases go
through one environment, one after the other; pip keeps their wheels for the next time.

    python open_in_each_onnxruntime.py ENVIRONMENT [MODELS]

ENVIRONMENT is a folder, made if it is not there, by the Python that runs this program; MODELS is the folder of the
released models, if not the repository's.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import venv
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
IN_THIS_ONE = Path(__file__).with_name("open_in_this_onnxruntime.py")
OF_THE_CONTRACT = 17  # minor version: docs/onnx_contract.md
WITH_NUMPY_1 = 18  # the last minor version that was built for NumPy 1 alone

SAMPLE = """
from importlib.resources import files

from deepmuon_runtime import Generator, list_models

models = list_models()
for model in models:
    which = {"architecture": model.architecture, "flux": model.flux, "medium": model.medium}
    assert len(Generator.open(model.depth_m, **which).sample(20_000, seed=1)) == 20_000
    Generator.open(file=files("deepmuon_models") / model.name)  # as a stranger's, with a trial
print(f"{len(models)} models sampled by the package")
"""


def declared_floor() -> str:
    """Return the version of ONNX Runtime from which on the package says that it runs."""
    found = re.search(r'"onnxruntime>=([\d.]+)"', (REPOSITORY / "pyproject.toml").read_text("utf-8"))
    assert found is not None, "pyproject.toml does not say which onnxruntime is needed"
    return found[1]


def minor(version: str) -> int:
    """Return the second number of a version."""
    major, number, *_ = version.split(".")
    assert major == "1", f"this program counts minor versions of onnxruntime 1, and there is {version}"
    return int(number)


class Environment:
    """A virtual environment in which one ONNX Runtime follows the other."""

    def __init__(self, folder: Path) -> None:
        self._python = folder / "bin" / "python"
        if not self._python.exists():
            venv.create(folder, with_pip=True)
        self.install("click", "h5py")

    def install(self, *packages: str) -> None:
        """Install packages, or stop with what pip says."""
        subprocess.run([self._python, "-m", "pip", "install", "-q", *packages], check=True)

    def install_onnxruntime(self, wanted: str, numpy: str) -> str:
        """Install an ONNX Runtime, as `==1.20.*`, beside a NumPy, and return its version."""
        self.install(f"onnxruntime{wanted}", f"numpy{numpy}")
        return self._run("-c", "import onnxruntime; print(onnxruntime.__version__)")

    def try_models(self, models: Path, by_package: bool) -> str:
        """Return what the programs say that run the models; raise CalledProcessError if one fails."""
        said = self._run(str(IN_THIS_ONE), str(models))
        return f"{said}; {self._run('-c', SAMPLE, path=models.parent)}" if by_package else said

    def _run(self, *arguments: str, path: Path | None = None) -> str:
        folders = os.pathsep.join(map(str, (path, REPOSITORY / "runtime"))) if path else ""
        done = subprocess.run(
            [self._python, *arguments],
            env={**os.environ, "PYTHONPATH": folders},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        return done.stdout.strip()


def main(folder: Path, models: Path) -> int:
    """Try all releases and return how many of them fail."""
    floor = declared_floor()
    environment = Environment(folder)
    newest = minor(environment.install_onnxruntime("", ">=2"))
    tried = [
        *((f"==1.{number}.*", number) for number in range(OF_THE_CONTRACT, newest + 1)),
        (f"=={floor}", minor(floor)),
    ]
    failed = []
    for wanted, number in sorted(tried, key=lambda release: release[1]):
        version = environment.install_onnxruntime(wanted, "<2" if number <= WITH_NUMPY_1 else ">=2")
        try:
            print(environment.try_models(models, by_package=number >= minor(floor)), flush=True)
        except subprocess.CalledProcessError:
            print(f"FAILED in ONNX Runtime {version}", flush=True)
            failed.append(version)
    print(f"{len(tried)} releases of ONNX Runtime tried, {len(failed)} failed{': ' * bool(failed)}{', '.join(failed)}")
    return len(failed)


if __name__ == "__main__":
    environment_folder, *others = map(Path, sys.argv[1:])
    sys.exit(min(1, main(environment_folder, others[0] if others else REPOSITORY / "models" / "deepmuon_models")))
