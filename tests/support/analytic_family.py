"""A small family all of whose distributions are known by formulas.

Through a sphere come muons with the density 3 c^2 of cos zenith c, through a plane 4 c^3. A kinetic energy above E GeV
has the probability 1 / (1 + E^2), at any angle. 100 exp(-depth / 20 m) muons a second cross a m2 of a plane.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from onnx import helper, parser

from support.tiny_families import FAMILY

__all__ = ["MEAN_COS", "MEAN_SIN", "PLANE_RATE", "SPHERE_RATE", "analytic_family"]

MEAN_COS, MEAN_SIN = 3 / 4, 3 * math.pi / 16  # of a sphere's muons
PLANE_RATE = 100 * math.exp(-0.5)  # at the default depth, 10 m
SPHERE_RATE = PLANE_RATE / MEAN_COS

GRAPH = """
<ir_version: 9, opset_import: ["" : 20]>
family (float[draws, 5] latent)
    => (float[muons] kinetic_energy, float[muons, 3] direction, int8[muons] charge, float[1] rate_hz_per_m2)
<
    float depth_m = {10}, int32 surface = {0},
    float low = {-0.99999994}, float high = {0.99999994},
    int64 i0 = {0}, int64 i1 = {1}, int64 i2 = {2}, int64 i3 = {3}, int64 i4 = {4},
    float zero = {0}, float half = {0.5}, float one = {1}, float four = {4}, float minus_one = {-1},
    float third = {0.33333333}, float fine_step = {5.9604644775390625e-8}, float pi = {3.1415927},
    float fading = {-0.05}, float at_top = {100}, int64[1] last = {1}, int64[1] flat = {-1}
>
{
    clipped = Clip(latent, low, high)
    l0 = Gather<axis = 1>(clipped, i0)
    l1 = Gather<axis = 1>(clipped, i1)
    l2 = Gather<axis = 1>(clipped, i2)
    l3 = Gather<axis = 1>(clipped, i3)
    l4 = Gather<axis = 1>(clipped, i4)
    fine = Mul(l1, fine_step)
    from_low = Add(one, l0)
    below = Add(from_low, fine)
    from_high = Sub(one, l0)
    above = Add(from_high, fine)
    odds = Div(below, above)
    kinetic_energy = Sqrt(odds)
    is_sphere = Cast<to = 1>(surface)
    power = Sub(four, is_sphere)
    root = Div(one, power)
    doubled = Add(one, l2)
    level = Mul(doubled, half)
    cosine = Pow(level, root)
    squared = Mul(cosine, cosine)
    rest = Sub(one, squared)
    sine = Sqrt(rest)
    azimuth = Mul(l3, pi)
    along_x = Cos(azimuth)
    along_y = Sin(azimuth)
    u = Mul(sine, along_x)
    v = Mul(sine, along_y)
    w = Neg(cosine)
    across = Unsqueeze(u, last)
    along = Unsqueeze(v, last)
    upward = Unsqueeze(w, last)
    direction = Concat<axis = 1>(across, along, upward)
    positive = Greater(l4, zero)
    sign = Where(positive, one, minus_one)
    charge = Cast<to = 3>(sign)
    faded = Mul(depth_m, fading)
    share = Exp(faded)
    of_plane = Mul(at_top, share)
    more = Mul(is_sphere, third)
    gain = Add(one, more)
    rate = Mul(of_plane, gain)
    rate_hz_per_m2 = Reshape(rate, flat)
}
"""

OF_DEPTH = ("is_sphere", "power", "root", "faded", "share", "of_plane", "more", "gain", "rate", "rate_hz_per_m2")
"""What depends on depth and surface alone."""


def analytic_family(metadata: Mapping[str, str | None] | None = None) -> bytes:
    """Return the family; metadata are values other than its own, None leaves a key out."""
    values = {
        **FAMILY,
        "latent_size": "5",
        "energy_latents": "0 1",
        "energy_min_gev": "1e-8",
        "energy_max_gev": "1e8",
        **(metadata or {}),
    }
    model = parser.parse_model(GRAPH)
    for node in model.graph.node:
        node.name = f"{'depth' if node.output[0] in OF_DEPTH else 'muon'}/{node.output[0]}"
    helper.set_model_props(model, {f"deepmuon.{key}": value for key, value in values.items() if value is not None})
    return bytes(model.SerializeToString())
