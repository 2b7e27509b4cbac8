"""CRC-32, the checksum of a column: that of zlib, gzip and PNG.

It finds every change of up to 32 bits in a row, and all but one in four thousand million of the others. A column's
is that of its bytes one after the other, whatever the pieces in which they are stored; those of parts can be joined.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

__all__ = ["joined_crc32", "unlike"]

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
