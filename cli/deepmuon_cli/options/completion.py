"""What the shell offers when Tab is pressed after an option; click does the rest."""

from __future__ import annotations

import click

__all__ = ["architectures", "depths", "devices"]


def depths(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Offer the depths [m] of the released models."""
    from deepmuon_runtime import list_models

    return _beginning({f"{model.depth_m:g}" for model in list_models()}, incomplete)


def architectures(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Offer the architectures of the released models."""
    from deepmuon_runtime import list_models

    return _beginning({model.architecture for model in list_models()}, incomplete)


def devices(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Offer the devices."""
    from deepmuon_runtime.model.device import DEVICES

    return _beginning(set(DEVICES), incomplete)


def _beginning(words: set[str], incomplete: str) -> list[str]:
    return sorted(word for word in words if word.startswith(incomplete))
