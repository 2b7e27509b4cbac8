"""Whether a model file may be run: a stranger's is looked through before ONNX Runtime sees it.

The file is walked as the Protocol Buffers message that it is, without the onnx package. Source of the field numbers:
https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
"""

from __future__ import annotations

from collections.abc import Callable

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.protobuf import fields

__all__ = ["LARGEST_IR_VERSION", "LARGEST_OPSET", "check_onnx_file"]

LARGEST_IR_VERSION = 9
LARGEST_OPSET = 20

LARGEST_COUNT = 1_000_000  # of outputs, for instance, for which ONNX Runtime takes memory before it counts them
MOST_FIELDS = 1_000_000  # seconds of walking
DEEPEST = 30  # messages inside of messages: a graph inside of a graph is three deeper

RANDOM = (
    "Bernoulli",
    "Dropout",
    "Multinomial",
    "RandomNormal",
    "RandomNormalLike",
    "RandomUniform",
    "RandomUniformLike",
)
ENDLESS = ("Loop", "Scan", "SequenceMap")


def check_onnx_file(content: bytes, name: str) -> None:
    """Raise RefusedError unless a model is complete in itself, and its operators are standard, repeatable, and end.

    Parameters
    ----------
    content
        The file.
    name
        What to call it in an error.

    Raises
    ------
    RefusedError
        If it is no message of Protocol Buffers; has an IR version above 9 or an opset above 20; has functions,
        operators of another domain than the standard one, random ones or loops; keeps numbers in another file; has
        training information; or is nested or repeated without reason.
    """
    try:
        _Walk().look_through("model", memoryview(content), DEEPEST)
    except ValueError as error:
        raise RefusedError(f"{name} is no ONNX model: {error}") from error
    except _BreachError as error:
        raise RefusedError(f"{name} breaks the contract: {error}") from error


class _BreachError(Exception):
    """What a model may not have."""


def _at_most(largest: int, meaning: str) -> Callable[[int], None]:
    def check(number: int) -> None:
        if not number <= largest:
            raise _BreachError(f"its {meaning} is {number}, and should be {largest} at most")

    return check


def _check_domain(domain: memoryview) -> None:
    if bytes(domain) not in (b"", b"ai.onnx"):  # two names of the standard one
        raise _BreachError(f"it has operators of the domain {_shown(domain)}, and should have standard ones only")


def _check_operator(operator: memoryview) -> None:
    text = str(operator, "ascii", "replace")
    if text in RANDOM:
        raise _BreachError(f"its operator {text} draws random numbers, which should come in by the latents")
    if text in ENDLESS:
        raise _BreachError(f"its operator {text} could go on for ever")


def _refuse(what: str) -> Callable[[object], None]:
    def refuse(value: object) -> None:
        raise _BreachError(f"it {what}")

    return refuse


def _check_location(location: int) -> None:
    if location != 0:
        raise _BreachError("it keeps numbers in another file")


def _check_count(number: int) -> None:
    if LARGEST_COUNT < number < 1 << 63:  # above it is below 0
        raise _BreachError(f"an attribute of an operator is {number}, and should be {LARGEST_COUNT} at most")


def _shown(text: memoryview) -> str:
    return ascii(str(text[:40], "utf-8", "replace"))


MESSAGES = {
    ("model", 7): "graph",
    ("model", 8): "opset",
    ("graph", 1): "node",
    ("graph", 5): "tensor",
    ("graph", 15): "sparse tensor",
    ("node", 5): "attribute",
    ("attribute", 5): "tensor",
    ("attribute", 6): "graph",
    ("attribute", 10): "tensor",
    ("attribute", 11): "graph",
    ("attribute", 22): "sparse tensor",
    ("attribute", 23): "sparse tensor",
    ("sparse tensor", 1): "tensor",
    ("sparse tensor", 2): "tensor",
}
"""What lies in which field of which message."""

NUMBERS: dict[tuple[str, int], Callable[[int], None]] = {
    ("model", 1): _at_most(LARGEST_IR_VERSION, "IR version"),
    ("opset", 2): _at_most(LARGEST_OPSET, "opset"),
    ("attribute", 3): _check_count,
    ("tensor", 14): _check_location,
}
TEXTS: dict[tuple[str, int], Callable[[memoryview], None]] = {
    ("model", 20): _refuse("says how it is to be trained"),
    ("model", 25): _refuse("has functions, and should have standard operators only"),
    ("opset", 1): _check_domain,
    ("node", 4): _check_operator,
    ("node", 7): _check_domain,
    ("tensor", 13): _refuse("keeps numbers in another file"),
}
"""What the other fields may hold."""


class _Walk:
    """A walk through a message and all that it holds."""

    def __init__(self) -> None:
        self._count = 0

    def look_through(self, kind: str, message: memoryview, depth: int) -> None:
        """Raise _BreachError or ValueError unless a message may be run; it may nest so deep."""
        if depth == 0:
            raise _BreachError("its graphs are nested without reason")
        for number, value in fields(message):
            self._count += 1
            if self._count > MOST_FIELDS:
                raise _BreachError(f"it has more than {MOST_FIELDS} parts")
            key = kind, number
            # A field of the wrong wire type is none: whoever reads the message skips it.
            if isinstance(value, int):
                if key in NUMBERS:
                    NUMBERS[key](value)
            elif key in MESSAGES:
                self.look_through(MESSAGES[key], value, depth - 1)
            elif key in TEXTS:
                TEXTS[key](value)
