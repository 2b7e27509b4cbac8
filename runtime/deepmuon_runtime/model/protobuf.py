"""Protocol Buffers' wire format: just enough to walk through a message without its schema.

A message is a row of fields. Each is a tag, field number times 8 plus wire type, and a value: a varint (type 0),
8 or 4 bytes (1 and 5), or a length and so many bytes (2), which are a text, numbers, or a message in turn.
Source: https://protobuf.dev/programming-guides/encoding/
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

__all__ = ["field", "fields", "parts", "varint_field", "with_changed"]

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
    for number, value, _ in parts(message):
        yield number, value


def field(number: int, content: bytes) -> bytes:
    """Return a field that holds a text, numbers or a message."""
    return _as_varint(number << 3 | LENGTH) + _as_varint(len(content)) + content


def varint_field(number: int, value: int) -> bytes:
    """Return a field that holds a whole number from 0 on."""
    return _as_varint(number << 3 | VARINT) + _as_varint(value)


def with_changed(message: memoryview, number: int, change: Callable[[memoryview], bytes]) -> bytes:
    """Return a message whose fields of a number have other contents; all else stays, byte for byte.

    Raises
    ------
    ValueError
        If the bytes are no message.
    """
    return b"".join(
        field(number, change(value)) if found == number and isinstance(value, memoryview) else whole
        for found, value, whole in parts(message)
    )


def parts(message: memoryview) -> Iterator[tuple[int, int | memoryview, memoryview]]:
    """Yield what `fields` does, and all bytes of the field: joined again, they are the message.

    Raises
    ------
    ValueError
        If the bytes are no message.
    """
    position = 0
    while position < len(message):
        start = position
        tag, position = _varint(message, position)
        number, wire_type = tag >> 3, tag & 7
        if number == 0 or tag >= 1 << 32:
            raise ValueError(f"a field has the number {number}")
        if wire_type == VARINT:
            varint, position = _varint(message, position)
            yield number, varint, message[start:position]
            continue
        if wire_type == LENGTH:
            size, position = _varint(message, position)
        elif wire_type in FIXED:
            size = FIXED[wire_type]
        else:
            raise ValueError(f"a field has the wire type {wire_type}")
        if size > len(message) - position:
            raise ValueError("a field is cut off")
        value = message[position : position + size]
        position += size
        yield number, value, message[start:position]


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


def _as_varint(number: int) -> bytes:
    """Return the same of a number."""
    groups = [number >> shift & 0x7F for shift in range(0, max(number.bit_length(), 1), 7)]
    return bytes([*(group | 0x80 for group in groups[:-1]), groups[-1]])
