"""Small ONNX models that keep the contract, or break it in one place."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import onnx
from onnx import helper, parser

__all__ = ["METADATA", "RARELY_BAD", "release", "tiny_model"]

# Each muon takes 4 latents: kinetic energy exp(3 l0) GeV, cos zenith 0.55 + 0.4 l1, azimuth pi l2,
# mu+ where l3 > 0.
GRAPH = """
<ir_version: 9, opset_import: ["" : 20]>
tiny (float[draws, LATENT_SIZE] latent)
    => (float[muons] kinetic_energy, float[muons, 3] direction, int8[muons] charge)
<
    float low = {-1}, float high = {1}, int64[2] per_muon = {-1, 4}, int64[1] last = {1},
    int64 i0 = {0}, int64 i1 = {1}, int64 i2 = {2}, int64 i3 = {3},
    float three = {3}, float slope = {0.4}, float middle = {0.55}, float pi = {3.1415927},
    float one = {1}, float zero = {0}, float minus_one = {-1}
>
{
    clipped = Clip(latent, low, high)
    each = Reshape(clipped, per_muon)
    l0 = Gather<axis = 1>(each, i0)
    l1 = Gather<axis = 1>(each, i1)
    l2 = Gather<axis = 1>(each, i2)
    l3 = Gather<axis = 1>(each, i3)
    log_energy = Mul(l0, three)
    kinetic_energy = Exp(log_energy)
    tilt = Mul(l1, slope)
    cosine = Add(tilt, middle)
    cosine_squared = Mul(cosine, cosine)
    sine_squared = Sub(one, cosine_squared)
    sine = Sqrt(sine_squared)
    azimuth = Mul(l2, pi)
    along_x = Cos(azimuth)
    along_y = Sin(azimuth)
    u = Mul(sine, along_x)
    v = Mul(sine, along_y)
    w = Neg(cosine)
    across = Unsqueeze(u, last)
    along = Unsqueeze(v, last)
    upward = Unsqueeze(w, last)
    direction = Concat<axis = 1>(across, along, upward)
    positive = Greater(l3, zero)
    sign = Where(positive, one, minus_one)
    charge = Cast<to = 3>(sign)
}
"""

# Edits that make the energy negative where the first latent is close to 0.3.
RARELY_BAD = {
    "float one = {1}": "float one = {1}, float spot = {0.3}, float width = {0.00001}",
    "kinetic_energy = Exp(log_energy)": """
        good = Exp(log_energy)
        from_spot = Sub(l0, spot)
        distance = Abs(from_spot)
        bad = Less(distance, width)
        kinetic_energy = Where(bad, minus_one, good)
    """,
}

METADATA = {
    "contract_version": "1",
    "architecture": "quantile",
    "depth_m": "10.0",
    "medium": "G4_WATER",
    "energy_min_gev": "0.01",
    "energy_max_gev": "100.0",
    "created_by": "the tests",
    "licence": "BSD-3-Clause",
    "rate_hz_per_m2": "55.5",
    "rate_uncertainty_hz_per_m2": "0.1",
}


def tiny_model(
    muons_per_draw: int = 1,
    metadata: Mapping[str, str | None] | None = None,
    edits: Mapping[str, str] | None = None,
) -> bytes:
    """Return a model file.

    Parameters
    ----------
    muons_per_draw
        Muons of one row of latents; 4 latents each.
    metadata
        Values other than those of `METADATA`; None leaves a key out.
    edits
        Pieces of the graph's text, and what they are replaced by.
    """
    sizes = {"muons_per_draw": str(muons_per_draw), "latent_size": str(4 * muons_per_draw)}
    values = {**METADATA, **sizes, **(metadata or {})}
    text = GRAPH.replace("LATENT_SIZE", sizes["latent_size"])
    for old, new in (edits or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    model = parser.parse_model(text)
    helper.set_model_props(model, {f"deepmuon.{key}": value for key, value in values.items() if value is not None})
    return bytes(model.SerializeToString())


def release(folder: Path, models: Mapping[str, bytes], default_architecture: str = "quantile") -> None:
    """Write a package `deepmuon_models` with these files, by name, and their manifest."""
    package = folder / "deepmuon_models"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    entries = []
    for name, content in models.items():
        (package / name).write_bytes(content)
        properties = {prop.key: prop.value for prop in onnx.load_from_string(content).metadata_props}
        entries.append(
            {
                "file": name,
                "sha256": hashlib.sha256(content).hexdigest(),
                "size": len(content),
                **{key.removeprefix("deepmuon."): value for key, value in properties.items()},
            }
        )
    manifest = {"manifest_version": 1, "default_architecture": default_architecture, "models": entries}
    (package / "manifest.json").write_text(json.dumps(manifest))
