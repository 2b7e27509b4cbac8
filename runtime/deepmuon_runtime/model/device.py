"""The processor on which a model runs."""

from __future__ import annotations

import io
import os
import warnings
from contextlib import redirect_stdout
from importlib.util import find_spec

import onnxruntime

from deepmuon_runtime.errors import FailedError, RefusedError, first_line
from deepmuon_runtime.model.look_ups import with_gather

__all__ = ["DEVICES", "faster_device", "has_cupy", "load_session", "open_session"]

DEVICES = ("auto", "cpu", "cuda")

CPU_PROVIDER = "CPUExecutionProvider"
CUDA_PROVIDER = "CUDAExecutionProvider"

# TF32 keeps 10 bits of the mantissa: too few for muons that agree with the CPU's to float32 rounding.
CUDA_OPTIONS = {"use_tf32": "0"}

_REMOVE = "pip uninstall -y onnxruntime onnxruntime-gpu"
_INSTALL_CPU = f"{_REMOVE} && pip install onnxruntime"
_INSTALL_CUDA = f"{_REMOVE} && pip install 'onnxruntime-gpu[cuda,cudnn]'"


def has_cupy() -> bool:
    """Tell whether CuPy is installed, without importing it."""
    return find_spec("cupy") is not None


def faster_device(device: str, architecture: str) -> str:
    """Return "cpu" where "auto" was asked for and CUDA is known to be the slower one, else what was asked for.

    A `quantile` model is so fast on a processor that CUDA is worth while only where it makes the random numbers, too: a
    file took an H200 without CuPy 40 ns a muon, and the 16 cores beside it 36. A network is faster on CUDA.
    """
    return "cpu" if device == "auto" and architecture == "quantile" and not has_cupy() else device


def open_session(content: bytes, name: str, device: str) -> tuple[onnxruntime.InferenceSession, str]:
    """Load a model on a device.

    Parameters
    ----------
    content
        An ONNX file.
    name
        What to call it in an error.
    device
        "cpu"; "cuda"; or "auto", which is CUDA where it can be had, else the CPU.

    Returns
    -------
    The session, which may be run from several threads at once, and the device that it took, "cpu" or "cuda".

    Raises
    ------
    RefusedError
        If the content is no ONNX model that ONNX Runtime can run, or CUDA was asked for and can't be had.
    """
    if device not in DEVICES:
        raise RefusedError(f"no device {device!r}: there are {', '.join(DEVICES)}")
    _warn_of_two_runtimes()
    onnxruntime.set_default_logger_severity(4)  # what matters is raised
    if os.environ.get("ORT_DISABLE_TELEMETRY") == "1" and hasattr(onnxruntime, "disable_telemetry_events"):
        onnxruntime.disable_telemetry_events()  # where the program imported ONNX Runtime before this package
    has_cuda = CUDA_PROVIDER in onnxruntime.get_available_providers()
    if device == "cuda" and not has_cuda:
        raise RefusedError(
            "cuda can't be had: the installed ONNX Runtime is built for the CPU alone; replace it: " + _INSTALL_CUDA
        )
    if device == "cpu" or not has_cuda:
        return _load(content, name, CPU_PROVIDER), "cpu"
    session = _load_on_cuda(content, name)
    if session is not None:
        return session, "cuda"
    if device == "cuda":
        raise RefusedError(
            "cuda can't be had: ONNX Runtime could not start on a GPU; see that nvidia-smi lists one, "
            "and that the CUDA and cuDNN libraries are there: " + _INSTALL_CUDA
        )
    return _load(content, name, CPU_PROVIDER), "cpu"


def load_session(
    content: bytes, name: str, options: onnxruntime.SessionOptions, provider: str = CPU_PROVIDER
) -> onnxruntime.InferenceSession:
    """Load a model by one of ONNX Runtime's providers, with options beside those that all sessions have.

    Raises
    ------
    RefusedError
        If the content is no ONNX model that ONNX Runtime can run.
    FailedError
        If the memory does not suffice.
    """
    # One thread a run: several runs side by side are faster than one run on several threads.
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    options.add_session_config_entry("session.load_model_format", "ONNX")  # not the other one that it would guess
    settings = [(provider, CUDA_OPTIONS if provider == CUDA_PROVIDER else {})]
    try:
        return onnxruntime.InferenceSession(content, options, providers=settings, enable_fallback=0)
    except Exception as error:  # ONNX Runtime's own classes have no common base
        if isinstance(error, MemoryError) or "bad_alloc" in str(error) or "bad allocation" in str(error):
            raise FailedError(f"memory ran out when {name} was loaded") from error
        raise RefusedError(f"{name} is no ONNX model that can be run: {first_line(error)}") from error


def _load(content: bytes, name: str, provider: str) -> onnxruntime.InferenceSession:
    return load_session(content, name, onnxruntime.SessionOptions(), provider)


def _load_on_cuda(content: bytes, name: str) -> onnxruntime.InferenceSession | None:
    """Return a session on the GPU, or None: ONNX Runtime falls back to the CPU, or raises."""
    if hasattr(onnxruntime, "preload_dlls"):  # since 1.21: finds the libraries that pip installed
        with redirect_stdout(io.StringIO()):
            onnxruntime.preload_dlls(directory="")
    try:
        session = _load(with_gather(content), name, CUDA_PROVIDER)
    except (RefusedError, ValueError):
        return None
    return session if CUDA_PROVIDER in session.get_providers() else None


def _warn_of_two_runtimes() -> None:
    """Warn where both builds of ONNX Runtime are installed: each overwrites files of the other."""
    if _is_installed("onnxruntime") and _is_installed("onnxruntime-gpu"):
        warnings.warn(
            "onnxruntime and onnxruntime-gpu are both installed and cannot work side by side; "
            f"for the CPU: {_INSTALL_CPU}; for CUDA: {_INSTALL_CUDA}",
            stacklevel=2,
        )


def _is_installed(name: str) -> bool:
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        distribution(name)
    except PackageNotFoundError:
        return False
    return True
