"""Reads an exported file's numbers back, for an evaluation in PyTorch that no ONNX engine has a part in."""

from __future__ import annotations

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.export.exportable import Exportable
from deepmuon_training.export.graph import RATE
from deepmuon_training.export.stored import StoredGenerator
from deepmuon_training.generators.registry import architecture

__all__ = ["read_back", "read_numbers"]

BAKED = "baked_from"
"""Metadata of a file that the runtime made of a family."""


def read_back(contents: bytes) -> Exportable:
    """Return the generator that a file was exported from, as stored numbers.

    Parameters
    ----------
    contents
        Of an ONNX file that `deepmuon_training.export.onnx_export.export` wrote.

    Raises
    ------
    RefusedError
        If the generator found does not give the file's graph again, node by node and number by number: another
        exporter wrote it.
    """
    stored = StoredGenerator(contents)
    generator = _numbers(stored)
    if BAKED in stored.metadata:  # a family's nodes, with tables in the place of the first of them
        return generator
    again = generator.graph()[0]
    if RATE in stored.constants:
        again.constant(stored.constants[RATE], RATE)
    outputs = len(stored.graph.output)  # a node each, to give it its name
    if again.nodes != stored.graph.node[:-outputs] or again.initializers != list(stored.graph.initializer):
        raise RefusedError(f"a graph of architecture {generator.architecture} that this release would write otherwise")
    return generator


def read_numbers(contents: bytes) -> Exportable:
    """Return the same of a file whose nodes may be those of another release, if its numbers lie alike.

    Raises
    ------
    RefusedError
        If they do not.
    """
    return _numbers(StoredGenerator(contents))


def _numbers(stored: StoredGenerator) -> Exportable:
    name = stored.metadata.get("architecture", "none")
    try:
        return architecture(name).read_back(stored)
    except (RefusedError, KeyError, ValueError, StopIteration) as error:
        raise RefusedError(f"a graph of architecture {name} that this release does not write") from error
