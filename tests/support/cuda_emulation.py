"""CUDA without a GPU: the kernels as the C++ that they also are, and as much of CuPy as the runtime uses.

The kernels' own text is compiled by g++, with CUDA's words defined as plain C++, and run thread after thread on numpy's
arrays. So a test here tells what the kernels compute; not that CUDA compiles them, how fast they are, or that CuPy and
ONNX Runtime wait for each other.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

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
"""

KERNEL = re.compile(r'extern "C" __global__ void (\w+)\(([^)]*)\)')
LAUNCH = """
extern "C" void launch_{name}(unsigned int blocks, unsigned int threads, {parameters})
{{
    blockDim.x = threads;
    for (blockIdx.x = 0; blockIdx.x < blocks; ++blockIdx.x)
        for (threadIdx.x = 0; threadIdx.x < threads; ++threadIdx.x) {name}({names});
}}
"""


FUNCTIONS = {
    "ascontiguousarray",
    "asarray",
    "clip",
    "cumsum",
    "flatnonzero",
    "ones_like",
    "repeat",
    "tile",
    "where",
    "zeros_like",
}
"""Functions of numpy's, beside its ufuncs, that may be called with CuPy's arrays: looked up in CuPy's source."""


class Array(NDArrayOperatorsMixin):
    """An array as CuPy's are: numpy's functions know it, it never mixes with numpy's arrays, and `get` copies it here.

    So a test tells whether what is written with numpy's functions takes CuPy's arrays.
    """

    def __init__(self, held: Any) -> None:
        self._held = np.asarray(held)

    def __array__(self, *_: object, **__: object) -> np.ndarray:
        raise TypeError("Implicit conversion to a NumPy array is not allowed. Please use `.get()`")

    def __array_ufunc__(self, function: np.ufunc, method: str, *inputs: Any, out: Any = (), **options: Any) -> Any:
        result = getattr(function, method)(*_held(inputs), out=_held(out) or None, **options)
        return out[0] if out else Array(result)

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        if function.__name__ not in FUNCTIONS or not all(issubclass(kind, Array) for kind in types):
            return NotImplemented
        result = function(*_held(arguments), **{name: _held(value) for name, value in options.items()})
        return Array(result) if options.get("out") is None else options["out"]

    def __getitem__(self, index: Any) -> Array:
        return Array(self._held[_held(index)])

    def __setitem__(self, index: Any, value: Any) -> None:
        self._held[_held(index)] = _held(value)

    def __len__(self) -> int:
        return len(self._held)

    def __int__(self) -> int:
        return int(self._held)

    def __bool__(self) -> bool:
        return bool(self._held)

    @property
    def dtype(self) -> np.dtype:
        return self._held.dtype

    @property
    def shape(self) -> tuple[int, ...]:
        return self._held.shape

    @property
    def size(self) -> int:
        return self._held.size

    @property
    def data(self) -> Any:
        return SimpleNamespace(ptr=self._held.ctypes.data)

    def astype(self, kind: Any) -> Array:
        return Array(self._held.astype(kind))

    def reshape(self, *shape: int) -> Array:
        return Array(self._held.reshape(*shape))

    def ravel(self) -> Array:
        return Array(self._held.ravel())

    def fill(self, value: Any) -> None:
        self._held.fill(value)

    def sort(self) -> None:
        self._held.sort()

    def get(self, out: np.ndarray | None = None) -> np.ndarray:
        if out is None:
            return self._held.copy()
        assert (out.shape, out.dtype) == (self.shape, self.dtype)
        out[...] = self._held
        return out


def _held(value: Any) -> Any:
    """Return what numpy works on in place of a value; raise where numpy's and CuPy's arrays are mixed."""
    if isinstance(value, tuple):
        return tuple(_held(one) for one in value)
    if isinstance(value, np.ndarray):
        raise TypeError(f"Unsupported type {type(value)}")
    return value._held if isinstance(value, Array) else value


def array(shape: Any, dtype: Any) -> Array:
    return Array(np.empty(shape, dtype))


@cache
def compiled(code: str) -> ctypes.CDLL:
    compiler = shutil.which("g++")
    assert compiler, "g++ is needed, which compiles the kernels"
    folder = Path(mkdtemp())
    try:
        launches = [
            LAUNCH.format(name=name, parameters=parameters, names=", ".join(re.findall(r"\w+(?=,|$)", parameters)))
            for name, parameters in KERNEL.findall(code)
        ]
        (folder / "kernels.cpp").write_text("\n".join([WORDS, code, *launches]), encoding="utf-8")
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
        kernel = self._library[f"launch_{name}"]

        def launch(grid: tuple[int], block: tuple[int], arguments: tuple[Any, ...]) -> None:
            kernel(*map(ctypes.c_uint, (*grid, *block)), *map(_passed, arguments))

        return launch


def _passed(argument: Any) -> Any:
    if isinstance(argument, Array):
        assert argument._held.flags.c_contiguous
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
        zeros=lambda shape, dtype: Array(np.zeros(shape, dtype)),
        arange=lambda *bounds, dtype: Array(np.arange(*bounds, dtype=dtype)),
        asarray=lambda column: Array(np.array(column)),
        ndarray=Array,
        RawModule=RawModule,
        cuda=SimpleNamespace(
            get_current_stream=lambda: stream, memory=SimpleNamespace(OutOfMemoryError=OutOfMemoryError)
        ),
    )
    cupyx.__dict__.update(empty_pinned=np.empty)
    return {"cupy": cupy, "cupyx": cupyx}
