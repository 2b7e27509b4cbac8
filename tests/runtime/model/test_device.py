from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import onnxruntime
import pytest

from deepmuon_runtime import Generator, RefusedError

CPU_BUILD = "CUDAExecutionProvider" not in onnxruntime.get_available_providers()
INSTALL = r"pip uninstall -y onnxruntime onnxruntime-gpu && pip install 'onnxruntime-gpu\[cuda,cudnn\]'"


def test_the_cpu_can_always_be_had(model_file):
    assert Generator.open(file=model_file, device="cpu").device == "cpu"


@pytest.mark.skipif(not CPU_BUILD, reason="this ONNX Runtime may have a GPU")
def test_auto_says_that_it_took_the_cpu(model_file):
    assert Generator.open(file=model_file).device == "cpu"


@pytest.mark.skipif(not CPU_BUILD, reason="this ONNX Runtime may have a GPU")
def test_cuda_without_its_package_is_refused_with_the_commands_that_install_it(model_file):
    with pytest.raises(RefusedError, match=f"built for the CPU alone.*{INSTALL}"):
        Generator.open(file=model_file, device="cuda")


@pytest.fixture
def cuda_without_gpu(monkeypatch):
    """The CUDA build of ONNX Runtime on a machine where CUDA does not start."""
    if not CPU_BUILD:
        pytest.skip("this ONNX Runtime may have a GPU")
    providers = ["CUDAExecutionProvider", "CPUExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: providers)


@pytest.mark.usefixtures("cuda_without_gpu")
def test_cuda_that_does_not_start_is_refused_and_never_the_cpu_instead(model_file):
    with pytest.raises(RefusedError, match=f"could not start on a GPU.*nvidia-smi.*{INSTALL}"):
        Generator.open(file=model_file, device="cuda")


@pytest.mark.usefixtures("cuda_without_gpu")
def test_auto_takes_the_cpu_where_cuda_does_not_start(model_file):
    assert Generator.open(file=model_file, device="auto").device == "cpu"


def test_an_unknown_device_is_refused(model_file):
    with pytest.raises(RefusedError, match="there are auto, cpu, cuda"):
        Generator.open(file=model_file, device="gpu")


def test_two_builds_of_onnx_runtime_side_by_side_bring_a_warning(
    model_file, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.syspath_prepend(tmp_path)
    for package in ("onnxruntime", "onnxruntime_gpu"):
        metadata = tmp_path / f"{package}-1.20.0.dist-info" / "METADATA"
        metadata.parent.mkdir()
        metadata.write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.20.0\n")
    with pytest.warns(UserWarning, match=f"cannot work side by side.*{INSTALL}"):
        Generator.open(file=model_file, device="cpu")


def test_onnx_runtime_keeps_no_identifier_and_sends_nothing(model_file):
    """Its newer releases would store one in the home folder, and say so where they can't."""
    program = f"from deepmuon_runtime import Generator; Generator.open(file={str(model_file)!r}).sample(10)"
    environment = {"HOME": str(model_file / "nowhere"), "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_an_error_of_onnx_runtime_without_a_text_is_told_by_its_name(model_file, monkeypatch):
    class WordlessError(Exception):
        """As one version raises it on some damaged models."""

    def refuse(*arguments, **options):
        raise WordlessError

    monkeypatch.setattr(onnxruntime, "InferenceSession", refuse)
    with pytest.raises(RefusedError, match=r"can be run: WordlessError$"):
        Generator.open(file=model_file, device="cpu")
