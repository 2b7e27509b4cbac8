"""Small families that keep the ONNX contract: any depth from 0 to 100 m, interpolated linearly between three knots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from support.tiny_models import METADATA

__all__ = ["KNOTS", "tiny_families", "tiny_family", "tiny_rate", "tiny_tables"]

KNOTS = np.float32([0, 50, 100])
"""Depths in metres."""

# Maps by surface (horizontal plane, sphere), knot and latent from -1 to 1: ln E/GeV and cos zenith. The charge has one
# number, the latent above which a muon is positive.
LOG_ENERGY = np.float32([[np.linspace(low, high, 5) for low, high in ((-3, 2), (-2, 3), (-1, 4))]] * 2)
COS_ZENITH = np.float32(
    [[np.linspace(low, 0.95, 4) for low in (0.2, 0.3, 0.5)], [np.linspace(low, 0.9, 4) for low in (0.1, 0.2, 0.4)]]
)
THRESHOLD = np.float32([[[0.1], [0.0], [-0.1]]] * 2)
RATE = np.float32([[[110], [10], [2]], [[150], [14], [3]]])  # /(m2 s)

FAMILY = {
    **METADATA,
    "contract_version": "2",
    "depth_m": "10",
    "flux": "test",
    "medium": "water",
    "surface": "0",
    "depth_min_m": "0",
    "depth_max_m": "100",
    "rate_relative_uncertainty": "0.002",
    "muons_per_draw": "1",
    "latent_size": "4",
    "rate_hz_per_m2": None,
    "rate_uncertainty_hz_per_m2": None,
}
REFINED = 33  # numbers of a table that is looked up in


def tiny_family(
    metadata: Mapping[str, str | None] | None = None,
    *,
    raw: bool = True,
    has_sphere: bool = True,
    changes: Mapping[str, Any] | None = None,
) -> bytes:
    """Return a family.

    Parameters
    ----------
    metadata
        Values other than those of `FAMILY`; None leaves a key out.
    raw
        Whether its numbers are stored as raw bytes, or in fields of their type.
    has_sphere
        Whether it has tables of a sphere's flux.
    changes
        Initializers other than its own, by name; None leaves one out.
    """
    constants: dict[str, Any] = {
        "depth_m": np.float32(10),
        "knots": np.float32([[0, 1, 2]]),
        "spacing": np.float32(50),
        "one": np.float32(1),
        "maps/energy": LOG_ENERGY,
        "maps/zenith": COS_ZENITH,
        "maps/charge": THRESHOLD,
        "maps/rate": RATE,
        "energy/refining": _refining(5),
        "zenith/refining": _refining(4),
        "as_row": np.int64([1, -1]),
        "flat": np.int64([-1]),
        "low": np.float32(-1),
        "high": np.float32(1),
        "scale": np.float32((REFINED - 1) / 2),
        "pi": np.float32(np.pi),
        "minus_one": np.float32(-1),
        **{f"column_{k}": np.int64(k) for k in range(4)},
        "last": np.int64([1]),
    }
    if has_sphere:
        constants["surface"] = np.int32(0)
    else:
        constants |= {name: table[0] for name, table in constants.items() if name.startswith("maps/")}
    constants |= changes or {}
    nodes = [*_depth(has_sphere), *_muons()]
    names = [f"{_room(outputs)}/{operator}_{k}" for k, (operator, _, outputs, _) in enumerate(nodes)]
    graph = helper.make_graph(
        [
            helper.make_node(operator, inputs, outputs, name=name, **attributes)
            for name, (operator, inputs, outputs, attributes) in zip(names, nodes, strict=True)
        ],
        "family",
        [helper.make_tensor_value_info("latent", TensorProto.FLOAT, ["draws", 4])],
        [
            helper.make_tensor_value_info("kinetic_energy", TensorProto.FLOAT, ["muons"]),
            helper.make_tensor_value_info("direction", TensorProto.FLOAT, ["muons", 3]),
            helper.make_tensor_value_info("charge", TensorProto.INT8, ["muons"]),
            helper.make_tensor_value_info("rate_hz_per_m2", TensorProto.FLOAT, [1]),
        ],
        [_tensor(name, np.asarray(value), raw) for name, value in constants.items() if value is not None],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=9)
    values = {**FAMILY, **(metadata or {})}
    helper.set_model_props(model, {f"deepmuon.{key}": value for key, value in values.items() if value is not None})
    return bytes(model.SerializeToString())


def tiny_families() -> dict[str, bytes]:
    """Return families of three fluxes and media, by the names of their files: to 100, 5000 and 2500 m."""
    return {
        f"{name}.onnx": tiny_family(
            {"flux": flux, "medium": medium, "depth_max_m": str(depth), "training_muons": "68000000"},
            changes={"spacing": np.float32(depth / 2)},
        )
        for name, flux, medium, depth in (
            ("quantile-water", "cry", "water", 100),
            ("measured-water", "measured", "water", 5000),
            ("measured-rock", "measured", "rock", 2500),
        )
    }


def tiny_tables(depth_m: float, surface: int = 0) -> list[np.ndarray]:
    """Return the coarse tables of a depth: of ln E, cos zenith and charge."""
    return [_between(maps[surface], depth_m) for maps in (LOG_ENERGY, COS_ZENITH, THRESHOLD)]


def tiny_rate(depth_m: float, surface: int = 0) -> float:
    """Return the rate of a depth."""
    return float(_between(RATE[surface], depth_m)[0])


def _between(maps: np.ndarray, depth_m: float) -> np.ndarray:
    return np.array([np.interp(depth_m, KNOTS, column) for column in maps.T.astype(float)])


def _refining(size: int) -> np.ndarray:
    """Return the matrix that interpolates a table of so many numbers linearly."""
    at = np.linspace(0, size - 1, REFINED)
    return np.float32(np.maximum(0, 1 - np.abs(at - np.arange(size)[:, None])))


_Node = tuple[str, Sequence[str], list[str], dict[str, Any]]


def _depth(has_sphere: bool) -> list[_Node]:
    """The nodes that make the coarse tables and the rate of a depth."""
    nodes: list[_Node] = [
        ("Div", ["depth_m", "spacing"], ["depth/at"], {}),
        ("Sub", ["depth/at", "knots"], ["depth/from_knots"], {}),
        ("Abs", ["depth/from_knots"], ["depth/distance"], {}),
        ("Sub", ["one", "depth/distance"], ["depth/hat"], {}),
        ("Relu", ["depth/hat"], ["depth/weights"], {}),
    ]
    for table, end in _ENDS.items():
        maps = f"maps/{table}"
        if has_sphere:
            nodes.append(("Gather", [maps, "surface"], [f"depth/maps_{table}"], {"axis": 0}))
            maps = f"depth/maps_{table}"
        nodes.append(("MatMul", ["depth/weights", maps], [f"depth/row_{table}"], {}))
        nodes.append(("Reshape", [f"depth/row_{table}", "flat"], [end], {}))
    return nodes


def _muons() -> list[_Node]:
    """The nodes after them."""
    nodes: list[_Node] = [("Clip", ["latent", "low", "high"], ["latent/clipped"], {})]
    for k in range(4):
        nodes.append(("Gather", ["latent/clipped", f"column_{k}"], [f"latent/{k}"], {"axis": 1}))
    for k, table in enumerate(("energy", "zenith")):
        nodes += [
            ("Reshape", [f"{table}/table", "as_row"], [f"{table}/row"], {}),
            ("MatMul", [f"{table}/row", f"{table}/refining"], [f"{table}/refined_row"], {}),
            ("Reshape", [f"{table}/refined_row", "flat"], [f"{table}/refined"], {}),
            ("Add", [f"latent/{k}", "one"], [f"{table}/from_start"], {}),
            ("Mul", [f"{table}/from_start", "scale"], [f"{table}/position"], {}),
            ("Cast", [f"{table}/position"], [f"{table}/index"], {"to": TensorProto.INT32}),
            ("GatherElements", [f"{table}/refined", f"{table}/index"], [f"{table}/look_up/found"], {"axis": 0}),
        ]
    return [
        *nodes,
        ("Exp", ["energy/look_up/found"], ["kinetic_energy"], {}),
        ("Mul", ["zenith/look_up/found"] * 2, ["zenith/squared"], {}),
        ("Sub", ["one", "zenith/squared"], ["zenith/sine_squared"], {}),
        ("Sqrt", ["zenith/sine_squared"], ["zenith/sine"], {}),
        ("Mul", ["latent/2", "pi"], ["azimuth/angle"], {}),
        ("Cos", ["azimuth/angle"], ["azimuth/x"], {}),
        ("Sin", ["azimuth/angle"], ["azimuth/y"], {}),
        ("Mul", ["zenith/sine", "azimuth/x"], ["direction/u"], {}),
        ("Mul", ["zenith/sine", "azimuth/y"], ["direction/v"], {}),
        ("Neg", ["zenith/look_up/found"], ["direction/w"], {}),
        *(("Unsqueeze", [f"direction/{axis}", "last"], [f"direction/column_{axis}"], {}) for axis in "uvw"),
        ("Concat", [f"direction/column_{axis}" for axis in "uvw"], ["direction"], {"axis": 1}),
        ("Greater", ["latent/3", "charge/table"], ["charge/is_positive"], {}),
        ("Where", ["charge/is_positive", "one", "minus_one"], ["charge/sign"], {}),
        ("Cast", ["charge/sign"], ["charge"], {"to": TensorProto.INT8}),
    ]


_ENDS = {"energy": "energy/table", "zenith": "zenith/table", "charge": "charge/table", "rate": "rate_hz_per_m2"}


def _room(outputs: list[str]) -> str:
    """Return the beginning of a node's name; that of a node that makes the depth is `depth`."""
    return "depth" if outputs[0] in _ENDS.values() else outputs[0].rpartition("/")[0] or outputs[0]


def _tensor(name: str, value: np.ndarray, raw: bool) -> onnx.TensorProto:
    if raw:
        return numpy_helper.from_array(value, name)
    return helper.make_tensor(name, helper.np_dtype_to_tensor_dtype(value.dtype), value.shape, value.flatten().tolist())
