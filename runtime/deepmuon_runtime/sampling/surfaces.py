"""A model's flux through a horizontal plane and through a sphere: loaded when they are asked for."""

from __future__ import annotations

import warnings

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import HORIZONTAL_PLANE, Model
from deepmuon_runtime.model.released import list_models
from deepmuon_runtime.sampling.source import TRIED, Source
from deepmuon_runtime.targets.target import Target

__all__ = ["Surfaces"]

NOTED_DIFFERENCE = 0.05  # of the rates at the top and at the foot of a body


class Surfaces:
    """A model of one depth, with the flux through each surface that it has.

    Parameters
    ----------
    contents, name
        A model file, and what to call it in an error.
    depth_m
        Of a family, the wanted depth.
    device
        As for `load_model`.
    is_stranger
        Whether a block of its muons might take any memory: that is tried before it is loaded for good.

    Attributes
    ----------
    own : Source
        The surface that the file says.

    Raises
    ------
    RefusedError
        If there is no such depth, it breaks the contract, or the device can't be had.
    """

    def __init__(self, contents: bytes, name: str, depth_m: float | None, device: str, is_stranger: bool) -> None:
        self._contents, self._name, self._depth, self._device = contents, name, depth_m, device
        self.own = self._loaded(None, is_stranger)
        self._loaded_ones = {self.own.model.surface: self.own}

    def of(self, target: Target | None) -> Source:
        """Return the source of the muons that hit a target.

        Raises
        ------
        RefusedError
            If the model has no flux through its surface.
        """
        if target is None:
            return self.own
        if target.surface not in self._loaded_ones:
            if not self.own.model.is_family:
                raise RefusedError(self._lacking(target))
            self._loaded_ones[target.surface] = self._loaded(target.surface, False)
        return self._loaded_ones[target.surface]

    def warn_of_height(self, target: Target) -> None:
        """Warn where the flux at the top of a body is not that at its foot: it gets that of its centre."""
        model, half = self.own.model, target.vertical_size / 2
        if model.depth_min_m is None or model.depth_max_m is None or not half or not model.depth_m > 0:
            return
        depths = [max(model.depth_m - half, model.depth_min_m), min(model.depth_m + half, model.depth_max_m)]
        top, foot = (self._rate(depth, target.surface) for depth in depths)
        if top is not None and foot is not None and abs(top - foot) > NOTED_DIFFERENCE * min(top, foot):
            warnings.warn(
                f"the {target.name} gets the muons of its centre, at {model.depth_m:g} m, all over: {top:g} a second "
                f"and m2 come to its top, at {depths[0]:g} m, and {foot:g} to its foot, at {depths[1]:g} m",
                stacklevel=4,
            )

    def _rate(self, depth_m: float, surface: int) -> float | None:
        from deepmuon_runtime.model.opening import checked_model, load_model

        return load_model(*checked_model(self._contents, self._name, depth_m, surface), "cpu")[1].rate_hz_per_m2

    def _loaded(self, surface: int | None, is_stranger: bool) -> Source:
        from deepmuon_runtime.model.opening import checked_model, load_model

        contents, model = checked_model(self._contents, self._name, self._depth, surface)
        if is_stranger:
            _try_memory(contents, model)
        source = Source(*load_model(contents, model, self._device))
        source.try_out()
        return source

    def _lacking(self, target: Target) -> str:
        has, needs = "the muons of a sphere", "those of a horizontal plane"
        own = self.own.model
        if own.surface == HORIZONTAL_PLANE:
            has, needs = "the muons of a horizontal plane", "those of a sphere, which come from all sides"
        like_it = [model for model in list_models() if (model.flux, model.medium) == (own.flux, own.medium)]
        families = [f"{model.name} of the released models" for model in like_it if model.is_family]
        instead = families[0] if families else "a family (deepmuon-train family)"
        return f"{self._name} has {has}, and a {target.name} needs {needs}: take {instead}"


def _try_memory(contents: bytes, model: Model) -> None:
    """Refuse a model of which a block of muons takes too much memory, before it is loaded for good."""
    from deepmuon_runtime.model.contract import check_signature
    from deepmuon_runtime.model.trial import open_for_trial, returning_memory

    session = open_for_trial(contents, model.name)
    check_signature(session, model)
    source = Source(session, model, "cpu")
    for draws in (TRIED, source.block_draws):
        source.try_out(draws, returning_memory())
