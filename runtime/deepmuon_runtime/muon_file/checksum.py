"""CRC-32, the checksum of columns and attributes: that of zlib, gzip and PNG.

It finds every change of up to 32 bits in a row, and all but one in four thousand million of the others. A column's
is that of its bytes one after the other, whatever the pieces in which they are stored; those of parts can be joined.
That of attributes is of a text which does not depend on how HDF5 stores them, so that any language can make it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

try:
    from isal.isal_zlib import crc32  # the extra `fast`: the same numbers in a quarter of the time
except ImportError:
    from zlib import crc32

__all__ = ["attributes_crc32", "crc32", "joined_crc32", "unlike"]

# Polynomials over the field of two elements are numbers here: the coefficient of x^k is bit 31 - k.
POLYNOMIAL = 0xEDB88320  # without its x^32
ONE = 1 << 31
ONE_BYTE = 1 << 23  # x^8


def joined_crc32(parts: Iterable[tuple[int, int]]) -> int:
    """Return the checksum of byte strings one after the other, from theirs.

    A checksum is the remainder of the bytes, as a polynomial, by CRC-32's; n bytes after it multiply it by x^(8 n).

    Parameters
    ----------
    parts
        For each byte string its checksum, as `zlib.crc32` gives it, and its length.

    Examples
    --------
    >>> from zlib import crc32
    >>> joined_crc32([(crc32(b"mu"), 2), (crc32(b"on"), 2)]) == crc32(b"muon")
    True
    """
    joined = 0
    for checksum, length in parts:
        joined = _product(joined, _bytes(length)) ^ checksum
    return joined


def attributes_crc32(attributes: Mapping[str, Any]) -> int:
    r"""Return the checksum of attributes: the CRC-32 of their names and values, each with a byte 0 after it.

    In the order of the names' bytes in UTF-8. A text is the letter s and its bytes in UTF-8; a whole number i and its
    decimal digits; another number f and the 16 hexadecimal digits of its float64, sign first; true and false are
    b1 and b0; a list is l and its length, and then each of its values, with a byte 0 after each.

    Parameters
    ----------
    attributes
        Values as Python's str, bytes, int, float, bool, and lists of them.

    Raises
    ------
    ValueError
        If one is something else.

    Examples
    --------
    >>> text = b"count\0i1000\0" b"depth_m\0f4024000000000000\0" b"medium\0sG4_WATER\0"
    >>> attributes_crc32({"medium": "G4_WATER", "depth_m": 10.0, "count": 1000}) == crc32(text)
    True
    """
    checksum = 0
    for name, value in sorted((name.encode(), value) for name, value in attributes.items()):
        try:
            checksum = crc32(name + b"\0" + _text(value), checksum)
        except ValueError as error:
            raise ValueError(f"the attribute {name.decode()} {error}") from error
    return checksum


def _text(value: Any) -> bytes:
    """Return a value and the byte 0 after it, of a list that of each of its values."""
    if isinstance(value, bool):
        return b"b1\0" if value else b"b0\0"
    if isinstance(value, int):
        return b"i%d\0" % value
    if isinstance(value, float):
        return b"f%b\0" % struct.pack(">d", value).hex().encode()
    if isinstance(value, (str, bytes)):
        return b"s%b\0" % (value.encode() if isinstance(value, str) else value)
    if isinstance(value, list):
        return b"l%d\0" % len(value) + b"".join(map(_text, value))
    raise ValueError(f"is {ascii(value)[:80]}, and should be a text, a number, true or false, or a list of them")


def unlike(found: int, expected: int) -> str:
    """Return what is wrong with bytes whose checksum is another one, for an error."""
    return f"is not what was written: its CRC-32 is {found:08x}, and should be {expected:08x}"


def _product(a: int, b: int) -> int:
    product = 0
    for bit in range(31, -1, -1):
        if a >> bit & 1:
            product ^= b
        b = b >> 1 ^ POLYNOMIAL if b & 1 else b >> 1
    return product


@lru_cache  # the parts of a file are of one or two lengths
def _bytes(length: int) -> int:
    """Return x^(8 length)."""
    power, base = ONE, ONE_BYTE
    while length:
        if length & 1:
            power = _product(power, base)
        base = _product(base, base)
        length >>= 1
    return power
