"""What an architecture is: all that the rest of the package has to know of a kind of generator."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

from deepmuon_training.export.exportable import Exportable, Family
from deepmuon_training.export.stored import StoredGenerator
from deepmuon_training.families.rates import KnownRate
from deepmuon_training.learning.support import Support
from deepmuon_training.sample import Sample

__all__ = ["Architecture", "Azimuth", "Fit"]

Azimuth = Literal["uniform", "learned"]

Settings = TypeVar("Settings")
Networks = TypeVar("Networks")


@dataclass(frozen=True)
class Fit(Generic[Networks]):
    """What came of a fit.

    Parameters
    ----------
    networks
        With their preprocessing, as the architecture has them.
    notes : tuple of str
        What their users should know.
    unphysical_before_mapping : float or None
        Fraction of the networks' muons that the graph has to mend; None where there can be none.
    """

    networks: Networks
    notes: tuple[str, ...]
    unphysical_before_mapping: float | None


class Architecture(ABC, Generic[Settings, Networks]):
    """A kind of generator: how it is fitted, kept, exported and read back.

    Attributes
    ----------
    name : str
        In commands, files and metadata.
    settings : type
        Dataclass with all that a fit can be told; its defaults made the released models.
    checkpoints : tuple of str
        Names of the files that an interrupted fit leaves.
    makes_families : bool
        Whether maps of several depths can be interpolated: `family` then does so.
    """

    name: str
    settings: type[Settings]
    checkpoints: tuple[str, ...]
    makes_families: bool = False

    def check_azimuth(self, azimuth: Azimuth) -> None:
        """Refuse a choice of the azimuth that this architecture does not leave; "uniform" stands for none.

        Raises
        ------
        RefusedError
            If there is no such choice.
        """
        return

    @abstractmethod
    def fit(
        self,
        sample: Sample,
        settings: Settings,
        *,
        seed: int,
        azimuth: Azimuth,
        support: Support,
        checkpoint_folder: Path | None,
        progress: bool,
    ) -> Fit[Networks]:
        """Fit networks to a sample, muons of which are nowhere but in the support.

        The other parameters are those of `deepmuon_training.generators.fit.fit_generator`.
        """

    @abstractmethod
    def pack(self, networks: Networks) -> dict[str, Any]:
        """Return the networks as what `torch.load` reads without executing anything: numbers, texts, tensors."""

    @abstractmethod
    def unpack(self, parts: dict[str, Any]) -> Networks:
        """Return what `pack` was given."""

    @abstractmethod
    def exportable(self, networks: Networks, seed: int) -> tuple[Exportable, tuple[str, ...]]:
        """Return the numbers that an ONNX file stores, and notes on how they differ from the networks.

        Raises
        ------
        FailedError
            If a map is not monotone.
        """

    def family(self, knots: Sequence[tuple[float, Any]], density: float, rates: Sequence[KnownRate]) -> Family:
        """Return a family, if this architecture `makes_families`.

        Parameters
        ----------
        knots
            Depth in metres and what `exportable` gives, of each knot, ascending.
        density
            Of the overburden in g/cm3.
        rates
            Ascending in depth, among them those of the knots; empty where unknown.

        Raises
        ------
        RefusedError
            If these knots can't be interpolated.
        """
        raise NotImplementedError

    @abstractmethod
    def read_back(self, stored: StoredGenerator) -> Exportable:
        """Return the numbers that an ONNX file was written of.

        Raises
        ------
        KeyError, ValueError, StopIteration
            If they are not where this architecture puts them.
        """
