"""Protocol Buffers' wire format: just enough to walk through a message without its schema.

A message is a row of fields. Each is a tag, field number times 8 plus wire type, and a value: a varint (type 0),
8 or 4 bytes (1 and 5), or a length and so many bytes (2), which are a text, numbers, or a message in turn.
Source: https://protobuf.dev/programming-guides/encoding/
"""

from __future__ import annotations

from collections.abc import Iterator

__all__ = ["fields"]

VARINT, EIGHT_BYTES, LENGTH, FOUR_BYTES = 0, 1, 2, 5
FIXED = {EIGHT_BYTES: 8, FOUR_BYTES: 4}


def fields(message: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Yield the number and the value of each field.

    Parameters
    ----------
    message
        Its bytes.

    Yields
    ------
    The field's number, and its value: a varint as an unsigned number, any other as its bytes.

    Raises
    ------
    ValueError
        If the bytes are no message.
    """
    position = 0
    while position < len(message):
        tag, position = _varint(message, position)
        number, wire_type = tag >> 3, tag & 7
        if number == 0 or tag >= 1 << 32:
            raise ValueError(f"a field has the number {number}")
        if wire_type == VARINT:
            value, position = _varint(message, position)
            yield number, value
            continue
        if wire_type == LENGTH:
            size, position = _varint(message, position)
        elif wire_type in FIXED:
            size = FIXED[wire_type]
        else:
            raise ValueError(f"a field has the wire type {wire_type}")
        if size > len(message) - position:
            raise ValueError("a field is cut off")
        yield number, message[position : position + size]
        position += size


def _varint(message: memoryview, position: int) -> tuple[int, int]:
    """Return a number of 7 bits a byte, the lowest first, and the position after it."""
    number = 0
    for shift in range(0, 70, 7):
        if position >= len(message):
            raise ValueError("a number is cut off")
        byte = message[position]
        position += 1
        number |= (byte & 0x7F) << shift
        if byte < 0x80:
            return number & 0xFFFF_FFFF_FFFF_FFFF, position
    raise ValueError("a number has more than ten bytes")
