"""What can be run here, each in an environment of its own: ``nox --list``; ``nox`` runs what CI does.

Environments lie in .nox and are used again. Python 3.11 is needed, others by the sessions that name them.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import nox

nox.needs_version = ">=2025.5.1"
nox.options.reuse_venv = "yes"
nox.options.download_python = "never"
nox.options.error_on_missing_interpreters = True
nox.options.sessions = [
    "environment",
    "lint",
    "types",
    "docs",
    "live",
    "engines",
    "tests",
    "wheels",
    "readme",
    "runtime-3.10",
    "runtime-3.12",
    "runtime-3.13",  # tests cover 3.11
    "trust",
    "onnxruntimes",
]

REPOSITORY = Path(__file__).parent
SITE = REPOSITORY / "docs" / "_build"
PYTHON, NEWEST = "3.11", "3.13"
TORCH = "torch==2.13.0"
"""Installed before whatever needs torch, in the version whose build for the CPU alone a machine may keep."""

ENGINES = "onnxruntime-node,onnxruntime-web,openvino,opencv-python-headless,tract"
LARGEST_WHEEL = 20_000_000  # bytes

WITHOUT_TORCH = """
from importlib.util import find_spec
assert find_spec("torch") is None and find_spec("onnx") is None, "the runtime must do without torch and onnx"
"""

MAIN_JOB = """
import sys
from deepmuon_runtime import read_attributes, read_muons
attributes, muons = read_attributes(sys.argv[1]), read_muons(sys.argv[1])
assert attributes["count"] == len(muons) == 10_000_000 and attributes["depth_m"] == 10
print(f"{len(muons)} muons, mean energy {muons.kinetic_energy.mean(dtype=float):.3f} GeV, without torch and onnx")
"""

SAME_VERSION = """
from importlib.metadata import requires, version
runtime = version("deepmuon-runtime")
assert version("deepmuon-training") == runtime
assert f"deepmuon-runtime=={runtime}" in requires("deepmuon-training"), requires("deepmuon-training")
print(f"deepmuon-training {runtime} needs deepmuon-runtime {runtime}")
"""


@nox.session(python=PYTHON)
def environment(session: nox.Session) -> None:
    """Install everything, for the sessions that need it: ``nox -s environment``."""
    session.install(TORCH)
    session.install(".[test,lint,docs]", "./training[test]")
    session.run("pip", "list")


@nox.session(python=PYTHON)
def lint(session: nox.Session) -> None:
    """Check errors and format of the Python code: ``nox -s lint``."""
    extras = nox.project.load_toml(REPOSITORY / "pyproject.toml")["project"]["optional-dependencies"]
    session.install(*(requirement for requirement in extras["lint"] if requirement.startswith("ruff")))
    session.run("ruff", "check")
    session.run("ruff", "format", "--check")


@nox.session(python=False, requires=["environment"])
def types(session: nox.Session) -> None:
    """Check the types of the packages: ``nox -s types``."""
    run(session, "mypy")


@nox.session(python=PYTHON)
def docs(session: nox.Session) -> None:
    """Build the site in docs/_build by the README's command, without torch; warnings are errors: ``nox -s docs``."""
    session.run("bash", "-c", readme_command("make_site"), external=True)
    session.run("python", "-c", "from importlib.util import find_spec; assert find_spec('torch') is None")


@nox.session(python=False, requires=["docs"])
def live(session: nox.Session) -> None:
    """Check the live page, its units, and all of it in Chromium: ``CHROMIUM=/usr/bin/chromium nox -s live``."""
    run(session, "npm", "run", "--silent", "lint")
    run(session, "npm", "test", "--silent")
    run(session, "npm", "run", "--silent", "test:browser", DEEPMUON_SITE=str(SITE))


@nox.session(python=PYTHON)
def engines(session: nox.Session) -> None:
    """Run the models in every engine, from Python, Node.js and C++, and let none be missing: ``nox -s engines``."""
    session.install(".[test,engines]")
    with session.chdir("tests/engines"):
        session.run("npm", "ci", external=True)
    session.run("pytest", "-q", "-s", "tests/examples/test_cpp.py", env={"DEEPMUON_ENGINES": ENGINES})
    session.run("pytest", "-q", "tests/engines", env={"DEEPMUON_ENGINES": ENGINES})


@nox.session(python=False, requires=["environment"])
def tests(session: nox.Session) -> None:
    """Run all tests, by the command that stands in the README: ``DEEPMUON_CRY=cry_sea_level.h5 nox -s tests``."""
    run(session, "bash", "-c", readme_command("pytest"))


@nox.session(python=["3.10", "3.11", "3.12", "3.13"])
def runtime(session: nox.Session) -> None:
    """Test the runtime without torch, its commands and the released models: ``nox -s runtime-3.12 -- -k seed``.

    The tests marked `campaign` take half of the time, and are for the newest Python, and 3.11 (``nox -s tests``).
    """
    session.install(".[test]")
    session.run("python", "-c", "from importlib.util import find_spec; assert find_spec('torch') is None")
    selected = () if session.python == NEWEST else ("-m", "not campaign")
    session.run("pytest", "-q", *selected, "tests/runtime", "tests/cli", "tests/models", *session.posargs)


@nox.session(python=PYTHON, reuse_venv=False)
def wheels(session: nox.Session) -> None:
    """Build both distributions, and let the small one do the main job: ``nox -s wheels``."""
    folder = Path(session.create_tmp())
    shutil.rmtree(folder / "dist", ignore_errors=True)
    session.install("build")
    for source in (".", "training"):
        session.run("python", "-m", "build", "--outdir", str(folder / "dist"), source)
    (small,) = (folder / "dist").glob("deepmuon_runtime-*.whl")
    (large,) = (folder / "dist").glob("deepmuon_training-*.whl")
    size = small.stat().st_size
    session.log(f"deepmuon-runtime's wheel has {size} bytes")
    if size >= LARGEST_WHEEL:
        session.error(f"that is more than {LARGEST_WHEEL}")
    session.install(str(small))
    if (Path(session.bin) / "deepmuon-train").exists():
        session.error("deepmuon-train belongs to deepmuon-training")
    with session.chdir(folder):  # away from the sources
        session.run("deepmuon-gen", "--depth", "10", "-n", "1e7", "--overwrite", "-o", "wheel.h5")
        check_main_job(session, folder / "wheel.h5")
        session.install("--no-deps", str(large))
        session.run("python", "-c", SAME_VERSION)


@nox.session(python=PYTHON, reuse_venv=False)
def readme(session: nox.Session) -> None:
    """Run the README's first command in a fresh environment: ``nox -s readme``."""
    muons = REPOSITORY / "muons.h5"
    muons.unlink(missing_ok=True)
    session.run("bash", "-c", readme_command("deepmuon-gen"), external=True)
    check_main_job(session, muons)


@nox.session(python=PYTHON)
def onnxruntimes(session: nox.Session) -> None:
    """Run the released models in every ONNX Runtime that contract and package allow: ``nox -s onnxruntimes``."""
    session.run("python", "tests/models/open_in_each_onnxruntime.py", f"{session.create_tmp()}/one")


@nox.session(python=False, requires=["environment"])
def trust(session: nox.Session) -> None:
    """Try faults and damaged files for a few minutes: ``nox -s trust -- --hours 1 --seed 7``."""
    run(session, "python", "-m", "studies.trust.run", *(session.posargs or ("--hours", "0.05")))


def run(session: nox.Session, program: str, *arguments: str, **variables: str) -> None:
    """Run a program with those of the session `environment` first on the path."""
    programs = Path(session.cache_dir).parent / "environment" / "bin"
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    found = shutil.which(program, path=path) or session.error(f"{program} was not found")
    session.run(found, *arguments, env={"PATH": path, **variables}, external=True)


def readme_command(word: str) -> str:
    """Return the one command of the README that mentions a word, as it stands there."""
    (command,) = re.findall(rf"^pip install .*{word}.*$", (REPOSITORY / "README.md").read_text("utf-8"), re.MULTILINE)
    print(f"$ {command}")
    return str(command)


def check_main_job(session: nox.Session, file: Path) -> None:
    """Look whether a file holds ten million muons of 10 m, and was made by the runtime alone."""
    session.run("python", "-c", WITHOUT_TORCH + MAIN_JOB, str(file))
    file.unlink()
