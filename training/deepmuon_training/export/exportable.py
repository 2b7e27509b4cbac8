"""What an ONNX file is written of."""

from __future__ import annotations

from typing import Protocol

import torch

from deepmuon_training.export.graph import Graph

__all__ = ["Exportable", "Family"]


class Exportable(Protocol):
    """A generator as stored numbers: what an ONNX file holds.

    ``__call__`` evaluates them in PyTorch: latents [draws, latent_size] to kinetic energy [muons] in GeV, direction
    [muons, 3] and charge [muons], in the latents' precision. ``graph`` builds the same in ONNX.
    """

    @property
    def architecture(self) -> str:
        """Its name."""

    @property
    def latent_size(self) -> int:
        """Uniform numbers of a draw."""

    @property
    def energy_latents(self) -> tuple[int, int] | None:
        """Coarse and fine latent with which alone the energy rises, as the contract says; None where there are none."""

    @property
    def muons_per_draw(self) -> int:
        """Muons made of them."""

    @property
    def energy_range(self) -> tuple[float, float]:
        """Lowest and highest kinetic energy [GeV]."""

    @property
    def energy_mean(self) -> float:
        """Mean of the transformed energy in training; for the record."""

    def __call__(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Evaluate in PyTorch."""

    def graph(self) -> tuple[Graph, str, str, str]:
        """Build the graph; returns it with the names of energy, direction and charge."""


class Family(Protocol):
    """Generators of any depth between those of the outermost knots, as stored numbers."""

    @property
    def architecture(self) -> str:
        """Its name."""

    @property
    def latent_size(self) -> int:
        """Uniform numbers of a draw."""

    @property
    def energy_latents(self) -> tuple[int, int] | None:
        """Coarse and fine latent with which alone the energy rises, as the contract says; None where there are none."""

    @property
    def muons_per_draw(self) -> int:
        """Muons made of them."""

    @property
    def energy_range(self) -> tuple[float, float]:
        """Lowest and highest kinetic energy [GeV] at any depth."""

    @property
    def depths(self) -> tuple[float, ...]:
        """Of the knots in metres, ascending."""

    @property
    def surfaces(self) -> tuple[int, ...]:
        """0 for a horizontal plane, 1 for a sphere."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What its users should know."""

    def at(self, depth_m: float, surface: int) -> Exportable:
        """Return the generator of a depth, for an evaluation in PyTorch in double precision."""

    def rate(self, depth_m: float, surface: int) -> float | None:
        """Return its rate; None where unknown."""

    def graph(self) -> tuple[Graph, str, str, str, str | None]:
        """Build the graph; returns it with the names of energy, direction, charge and rate, if that is known.

        Its depth and surface are the initializers ``depth_m``, that of the first knot, and ``surface``, 0; the names of
        nodes that depend on these alone begin with ``depth/``.
        """
