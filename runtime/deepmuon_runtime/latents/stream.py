"""Which stream of random numbers belongs to a model: two models of one seed have nothing in common."""

from __future__ import annotations

import numpy as np

__all__ = ["model_stream"]

OFFSET_BASIS = 0xCBF29CE484222325
PRIME = 0x100000001B3
MASK = 2**64 - 1


def model_stream(architecture: str, flux: str, medium: str, surface: int, depth_m: float) -> int:
    """Return the stream of a model's muons, the 64-bit FNV-1a hash of its description.

    That is the UTF-8 text `architecture/flux/medium/surface/`, followed by the depth as four bytes: a float32, the
    lowest byte first. Models that say the same of themselves share a stream, and so their muons at one seed are alike.

    Source: G. Fowler, L. C. Noll, K.-P. Vo, D. Eastlake, "The FNV Non-Cryptographic Hash Algorithm",
    https://datatracker.ietf.org/doc/html/draft-eastlake-fnv

    Parameters
    ----------
    architecture, flux, medium
        Names, as `Model` has them.
    surface
        What the muons cross: 0 is a horizontal plane.
    depth_m
        Metres of the medium.

    Returns
    -------
    0 to 2^64 - 1

    Examples
    --------
    >>> hex(model_stream("quantile", "cry", "water", 0, 10))
    '0xa55500202cca742a'
    """
    with np.errstate(over="ignore"):
        depth = np.float32(depth_m).astype("<f4").tobytes()
    stream = OFFSET_BASIS
    for byte in f"{architecture}/{flux}/{medium}/{surface}/".encode() + depth:
        stream = (stream ^ byte) * PRIME & MASK
    return stream
