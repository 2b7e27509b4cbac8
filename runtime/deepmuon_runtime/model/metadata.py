"""What a generator says of itself: the metadata of the ONNX contract, version 2.

Files of version 1, which lack the output of the rate, are read too: nothing else is different for who runs them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from deepmuon_runtime.errors import RefusedError, shown
from deepmuon_runtime.latents.stream import model_stream

__all__ = [
    "CONTRACT_VERSION",
    "HORIZONTAL_PLANE",
    "LARGEST_DRAW",
    "LATENTS_PER_MUON",
    "METADATA_PREFIX",
    "RATE_DIGITS",
    "SPHERE",
    "Model",
    "are_one_rate",
    "is_name",
    "is_rate",
]

CONTRACT_VERSION = 2
READ_VERSIONS = (1, 2)

LARGEST_DRAW = 1 << 17
"""The most muons of a draw: the smallest run of the network makes as many."""

LATENTS_PER_MUON = 8
"""For each muon of the largest draw, so many latents are the most of a draw."""

METADATA_PREFIX = "deepmuon."
"""Begins each key of the contract in a model's `metadata_props`."""


@dataclass(frozen=True)
class Model:
    """A generator's metadata.

    Parameters
    ----------
    name
        Name of the file.
    sha256
        Hash of the file, in hexadecimal.
    size
        Size of the file in bytes.
    architecture
        "quantile", "transformer", or another name.
    depth_m
        Depth of the plane that the muons cross, in metres of `medium`. Of a family in the list of the released models,
        the depth at which it is loaded where none is asked for.
    medium
        What lies above it: `water`, `rock`, or a Geant4 name.
    muons_per_draw
        Muons made of one row of latents.
    latent_size
        Uniform numbers in one row.
    energy_min_gev, energy_max_gev
        Range of the kinetic energy.
    created_by, licence
        Program that made the file, and the licence under which it may be used.
    flux
        The flux at the surface, by its name: `cry`. Where the file does not say it, the name of its creator.
    surface
        What the muons cross: 0 is a horizontal plane, 1 a sphere.
    depth_min_m, depth_max_m
        Depths that a family has; None in a model of one depth.
    rate_hz_per_m2, rate_uncertainty_hz_per_m2
        Muons through a horizontal square metre per second, of a sphere through one across their direction; None where
        unknown, and in a family that is not loaded: they go with the depth.
    rate_relative_uncertainty
        Of the rate, or None where unknown.
    energy_latents
        Which two latents the energy depends on, the coarse and the fine one, where it rises with them as the contract
        says; None where that is not known.
    metadata
        All of it as text, without the prefix of the keys.
    """

    name: str
    sha256: str
    size: int
    architecture: str
    depth_m: float
    medium: str
    muons_per_draw: int
    latent_size: int
    energy_min_gev: float
    energy_max_gev: float
    created_by: str
    licence: str
    flux: str
    surface: int
    depth_min_m: float | None
    depth_max_m: float | None
    rate_hz_per_m2: float | None
    rate_uncertainty_hz_per_m2: float | None
    rate_relative_uncertainty: float | None
    energy_latents: tuple[int, int] | None
    metadata: Mapping[str, str]

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any], name: str, sha256: str, size: int) -> Model:
        """Read the metadata of a model file.

        Parameters
        ----------
        metadata
            Keys of the contract, without the prefix; values as text or numbers.
        name, sha256, size
            As in the class.

        Raises
        ------
        RefusedError
            If a key of the contract is missing or its value is none that it can have.
        """
        texts = {key: str(value) for key, value in metadata.items()}
        missing = [key for key in _REQUIRED if key not in texts]
        if missing:
            keys = ", ".join(METADATA_PREFIX + key for key in missing)
            raise RefusedError(f"{name} breaks the contract: its metadata lacks {keys}")
        values = {key: _value(name, key, texts[key], rule) for key, rule in _REQUIRED.items()}
        for key, rule in _OPTIONAL.items():
            values[key] = _value(name, key, texts[key], rule) if key in texts else None
        if values["energy_min_gev"] >= values["energy_max_gev"]:
            raise RefusedError(f"{name} breaks the contract: energy_min_gev is not below energy_max_gev")
        _check_depths(name, values)
        _check_energy_latents(name, values)
        values["surface"] = values["surface"] or HORIZONTAL_PLANE
        values["flux"] = values["flux"] or _creator(values["created_by"])
        del values["contract_version"]
        return cls(name=name, sha256=sha256, size=size, metadata=texts, **values)

    @property
    def is_family(self) -> bool:
        """Whether the file has any depth from `depth_min_m` to `depth_max_m`."""
        return self.depth_min_m is not None

    @property
    def depths(self) -> str:
        """The depths that the file has, in metres: "10", or of a family "0 to 100"."""
        return f"{self.depth_min_m:g} to {self.depth_max_m:g}" if self.is_family else f"{self.depth_m:g}"

    def has_depth(self, depth_m: float) -> bool:
        """Tell whether the file has the muons of a depth; of a family depths are float32."""
        if self.depth_min_m is None or self.depth_max_m is None:
            return depth_m == self.depth_m
        with np.errstate(over="ignore"):
            least, depth, most = np.array([self.depth_min_m, depth_m, self.depth_max_m], np.float32)
        return bool(least <= depth <= most)

    @cached_property
    def stream(self) -> int:
        """The stream of random numbers that makes its muons, 0 to 2^64 - 1."""
        return model_stream(self.architecture, self.flux, self.medium, self.surface, self.depth_m)


HORIZONTAL_PLANE, SPHERE = 0, 1
"""Surfaces that muons cross."""


class _Rule(NamedTuple):
    """How a value is read from its text, and what it may be."""

    read: Callable[[str], Any]
    is_good: Callable[[Any], bool]
    meaning: str


def is_name(text: str) -> bool:
    """Tell whether a text can stand in a line: neither empty nor with a character that can't be printed."""
    return text != "" and text.isprintable()


def _two_latents(text: str) -> tuple[int, int]:
    coarse, fine = map(int, text.split())
    return coarse, fine


def _count(largest: int) -> _Rule:
    return _Rule(int, lambda x: 1 <= x <= largest, f"a whole number from 1 to {largest}")


# Muons are float32: a limit beyond it would be infinite, one below its normal numbers 0.
_LEAST, _MOST = float(np.finfo(np.float32).smallest_normal), float(np.finfo(np.float32).max)

_NAME = _Rule(str, is_name, "a name of printable characters")
_TEXT = _Rule(str, bool, "a text")
_POSITIVE = _Rule(float, lambda x: _LEAST <= x <= _MOST, f"a positive number from {_LEAST:.3g} to {_MOST:.3g}")
_NOT_NEGATIVE = _Rule(float, lambda x: 0 <= x < math.inf, "a number from 0 on")
_FLOAT32 = _Rule(float, lambda x: 0 <= x <= _MOST, f"a number from 0 to {_MOST:.3g}")

_REQUIRED = {
    "contract_version": _Rule(
        int, lambda x: x in READ_VERSIONS, f"{' or '.join(map(str, READ_VERSIONS))} for this release"
    ),
    "architecture": _NAME,
    "depth_m": _NOT_NEGATIVE,
    "medium": _NAME,
    "muons_per_draw": _count(LARGEST_DRAW),
    "latent_size": _count(LARGEST_DRAW * LATENTS_PER_MUON),
    "energy_min_gev": _POSITIVE,
    "energy_max_gev": _POSITIVE,
    "created_by": _TEXT,
    "licence": _TEXT,
}
_OPTIONAL = {
    "flux": _NAME,
    "surface": _Rule(int, lambda x: x in (HORIZONTAL_PLANE, SPHERE), "0, a horizontal plane, or 1, a sphere"),
    "depth_min_m": _FLOAT32,
    "depth_max_m": _FLOAT32,
    "rate_hz_per_m2": _POSITIVE,
    "rate_uncertainty_hz_per_m2": _NOT_NEGATIVE,
    "rate_relative_uncertainty": _NOT_NEGATIVE,
    "energy_latents": _Rule(
        _two_latents, lambda x: x[0] != x[1] and min(x) >= 0, "two positions of latents, as in 0 1"
    ),
}


RATE_DIGITS = 5
"""Of a rate that a graph gives in float32, whose last digits go with the type of CPU."""


def are_one_rate(rate: float, other: float) -> bool:
    """Tell whether two numbers are the rate of one model, but for its rounding."""
    return math.isclose(rate, other, rel_tol=10 ** (1 - RATE_DIGITS))


def is_rate(rate: float) -> bool:
    """Tell whether a number can be the rate of a model."""
    return _POSITIVE.is_good(rate)


def _check_depths(name: str, values: Mapping[str, Any]) -> None:
    """Refuse depths that are no family's and no single one."""
    least, most = values["depth_min_m"], values["depth_max_m"]
    if least is None and most is None:
        return
    if least is None or most is None:
        raise RefusedError(f"{name} breaks the contract: depth_min_m and depth_max_m go together, and one is missing")
    if not least < most:
        raise RefusedError(
            f"{name} breaks the contract: a family needs two depths or more, and depth_min_m, {least:g}, is not below "
            f"depth_max_m, {most:g}"
        )
    if not least <= values["depth_m"] <= most:
        raise RefusedError(
            f"{name} breaks the contract: depth_m is {values['depth_m']:g}, and should be from {least:g} to {most:g}"
        )
    if values["rate_hz_per_m2"] is not None or values["rate_uncertainty_hz_per_m2"] is not None:
        raise RefusedError(
            f"{name} breaks the contract: the rate of a family goes with the depth, and its metadata has one"
        )


def _check_energy_latents(name: str, values: Mapping[str, Any]) -> None:
    """Refuse latents of the energy that are none of a muon's own."""
    if values["energy_latents"] is None:
        return
    if values["muons_per_draw"] != 1 or max(values["energy_latents"]) >= values["latent_size"]:
        raise RefusedError(
            f"{name} breaks the contract: energy_latents goes with one muon a draw, and each is below latent_size"
        )


def _creator(created_by: str) -> str:
    """Return the name of the program without its version: what stands before the first digit and its spaces."""
    name, *_ = re.split("[0-9]", created_by, maxsplit=1)
    return name.rstrip(" ")


def _value(name: str, key: str, text: str, rule: _Rule) -> Any:
    try:
        value = rule.read(text)
        if rule.is_good(value):
            return value
    except ValueError:
        pass
    raise RefusedError(
        f"{name} breaks the contract: {METADATA_PREFIX}{key} is {shown(repr(text))}, and should be {rule.meaning}"
    )
