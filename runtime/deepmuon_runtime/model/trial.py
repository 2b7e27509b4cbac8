"""A trial of a stranger's model with little memory: what it asks for beyond that is refused, not taken."""

from __future__ import annotations

import re
from contextlib import suppress
from functools import cache

import onnxruntime

from deepmuon_runtime.model.device import load_session

__all__ = ["MOST_MEMORY", "memory_asked", "open_for_trial", "returning_memory"]

MOST_MEMORY = 1_000_000_000
"""Bytes that a block of muons may take: a hundred times what the released models do."""

ASKED = re.compile(r"(?:requested bytes of|requested buffer of size) (\d+)")


def open_for_trial(content: bytes, name: str) -> onnxruntime.InferenceSession:
    """Load a model on the CPU so that its runs take MOST_MEMORY bytes at most.

    Nothing of the graph is computed beforehand, as ONNX Runtime otherwise does where no latent comes in, in some
    releases beyond any limit.

    Raises
    ------
    RefusedError
        If the content is no ONNX model that ONNX Runtime can run.
    """
    _limit_memory()
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.add_session_config_entry("session.use_env_allocators", "1")
    return load_session(content, name, options)


def returning_memory() -> onnxruntime.RunOptions:
    """Return options of a run after which its memory is the system's again."""
    options = onnxruntime.RunOptions()
    options.add_run_config_entry("memory.enable_memory_arena_shrinkage", "cpu:0")
    return options


def memory_asked(error: Exception) -> str | None:
    """Return how much memory a run asked for in vain, in a few words, or None if it failed otherwise."""
    asked = ASKED.search(str(error))
    if asked is None:
        return None
    return f"it asks for {int(asked[1]) / 1e9:.2g} GB at once, and should take {MOST_MEMORY / 1e9:g} GB in all at most"


@cache
def _limit_memory() -> None:
    """Give the sessions that ask for it one memory of limited size: ONNX Runtime has one such for a process."""
    info = onnxruntime.OrtMemoryInfo(
        "Cpu", onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, onnxruntime.OrtMemType.DEFAULT
    )
    as_requested = 1  # the arena grows by what is asked for, not by the next power of two
    settings = onnxruntime.OrtArenaCfg({"max_mem": MOST_MEMORY, "arena_extend_strategy": as_requested})
    with suppress(Exception):  # the program has made one itself: then that one's limit holds
        onnxruntime.create_and_register_allocator(info, settings)
