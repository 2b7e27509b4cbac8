"""CUDA without a GPU: the kernels as the C++ that they also are, and as much of CuPy as the runtime uses.

The kernels' own text is compiled by g++, with CUDA's words defined as plain C++, and run thread after thread on numpy's
arrays. So a test here tells what the kernels compute; not that CUDA compiles them, how fast they are, or that CuPy and
ONNX Runtime wait for each other.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

WORDS = """
#include <cmath>
#define __global__
#define __device__ static
struct Place { unsigned int x; };
static thread_local Place blockIdx, blockDim, threadIdx;
static unsigned long long __umul64hi(unsigned long long a, unsigned long long b)
{
    return (unsigned long long)((unsigned __int128)a * b >> 64);
}
static void atomicMin(unsigned long long* kept, unsigned long long value) { if (value < *kept) *kept = value; }
extern "C" void at(unsigned int block, unsigned int threads, unsigned int thread)
{
    blockIdx.x = block; blockDim.x = threads; threadIdx.x = thread;
}
"""


class Array(np.ndarray):
    """An array as CuPy's are: with its address as `data.ptr`, and copied to the host by `get`."""

    @property
    def data(self) -> Any:
        return SimpleNamespace(ptr=self.ctypes.data)

    def get(self, out: np.ndarray | None = None) -> np.ndarray:
        copy = np.array(self.view(np.ndarray))
        if out is None:
            return copy
        out[...] = copy
        return out


def array(shape: Any, dtype: Any) -> Any:
    return np.empty(shape, dtype).view(Array)


@cache
def compiled(code: str) -> ctypes.CDLL:
    compiler = shutil.which("g++")
    assert compiler, "g++ is needed, which compiles the kernels"
    folder = Path(mkdtemp())
    try:
        (folder / "kernels.cpp").write_text(WORDS + code, encoding="utf-8")
        # Without fused operations each one is rounded, as numpy rounds.
        command = [compiler, "-O1", "-ffp-contract=off", "-Wno-unknown-pragmas", "-shared", "-fPIC"]
        subprocess.run([*command, "kernels.cpp", "-o", "kernels.so"], cwd=folder, check=True)
        return ctypes.CDLL(str(folder / "kernels.so"))
    finally:
        shutil.rmtree(folder)


class RawModule:
    """Kernels of one text."""

    def __init__(self, code: str) -> None:
        self._library = compiled(code)

    def get_function(self, name: str) -> Any:
        kernel = self._library[name]

        def launch(grid: tuple[int], block: tuple[int], arguments: tuple[Any, ...]) -> None:
            passed = [_passed(argument) for argument in arguments]
            for number in range(grid[0]):
                for thread in range(block[0]):
                    self._library.at(number, block[0], thread)
                    kernel(*passed)

        return launch


def _passed(argument: Any) -> Any:
    if isinstance(argument, Array):
        return ctypes.c_void_p(argument.data.ptr)
    kinds = {np.uint64: ctypes.c_uint64, np.float32: ctypes.c_float}
    return kinds[type(argument)](argument.item())


class OutOfMemoryError(MemoryError):
    """CuPy's."""


def modules() -> dict[str, ModuleType]:
    """Return modules to stand for CuPy's, by name."""
    cupy, cupyx = ModuleType("cupy"), ModuleType("cupyx")
    stream = SimpleNamespace(synchronize=lambda: None)
    cupy.__dict__.update(
        empty=array,
        asarray=lambda column: np.array(column).view(Array),
        ndarray=Array,
        RawModule=RawModule,
        cuda=SimpleNamespace(
            get_current_stream=lambda: stream, memory=SimpleNamespace(OutOfMemoryError=OutOfMemoryError)
        ),
    )
    cupyx.__dict__.update(empty_pinned=np.empty)
    return {"cupy": cupy, "cupyx": cupyx}
