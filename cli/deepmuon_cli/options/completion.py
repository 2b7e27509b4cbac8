"""What the shell offers when Tab is pressed after an option; click does the rest."""

from __future__ import annotations

from collections.abc import Iterator

import click

__all__ = ["architectures", "depths", "devices", "fluxes", "media"]

MODEL = ("architecture", "flux", "medium")
"""The options that choose among the released models, beside the depth."""


def depths(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Offer the depths [m] of the models that the options before choose: of a family the first and the last."""
    from deepmuon_runtime.errors import RefusedError
    from deepmuon_runtime.model.released import models_of

    try:
        models = models_of(**{name: context.params.get(name) for name in MODEL})
    except RefusedError:
        return []
    ends = [(model.depth_m,) if not model.is_family else (model.depth_min_m, model.depth_max_m) for model in models]
    return _beginning({f"{depth:g}" for each in ends for depth in each}, incomplete)


def architectures(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Offer the architectures of the released models."""
    return _beginning(set(_there(context, "architecture")), incomplete)


def fluxes(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Offer the fluxes of the released models."""
    return _beginning(set(_there(context, "flux")), incomplete)


def media(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Offer the media of the released models."""
    return _beginning(set(_there(context, "medium")), incomplete)


def devices(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Offer the devices."""
    from deepmuon_runtime.model.device import DEVICES

    return _beginning(set(DEVICES), incomplete)


def _there(context: click.Context, asked: str) -> Iterator[str]:
    """Yield what the released models have beside what the options before choose."""
    from deepmuon_runtime import list_models

    given = {name: value for name in MODEL if name != asked and (value := context.params.get(name)) is not None}
    for model in list_models():
        if all(getattr(model, name) == value for name, value in given.items()):
            yield getattr(model, asked)


def _beginning(words: set[str], incomplete: str) -> list[str]:
    return sorted(word for word in words if word.startswith(incomplete))
