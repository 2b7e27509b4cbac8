"""What a pipeline is told: all settings of a run, in one small TOML file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.latents.philox import LARGEST_SEED
from deepmuon_training.generators.architecture import Azimuth
from deepmuon_training.generators.fit import FEWEST_MUONS
from deepmuon_training.generators.registry import ARCHITECTURES, architecture
from deepmuon_training.pipeline.settings_file import read_table, settings_from
from deepmuon_training.ranges import Range, check_ranges
from deepmuon_training.scores import evaluate
from deepmuon_training.transport.material import DENSITIES, check_material

__all__ = ["PipelineSettings", "read_pipeline_settings"]

_MOST_MUONS = 100_000_000_000


@dataclass(frozen=True)
class PipelineSettings:
    """The settings of a pipeline, by the names that they have in its file; each may be left out.

    Parameters
    ----------
    architecture
        One of `deepmuon_training.generators.registry.ARCHITECTURES`.
    azimuth
        Of a `quantile` generator, "uniform" or "learned"; see `deepmuon_training.generators.fit.fit_generator`.
    layers
        Slabs below the sample's depth; 0 fits the sample and no more.
    layer_m
        Thickness of each slab in m.
    material, density
        What they are made of, Geant4's (NIST) name or standard_rock, and its density in g/cm3 if not its own.
    muons
        Drawn from each generator to be carried through the slab below it; without effect where `direct`.
    muons_per_part
        Muons that are carried between two savings.
    scored_muons
        Drawn from a generator to compare it with held-out muons.
    direct
        Carry the muons that came through the slab above, instead of those that its generator draws.
    family
        In the end make one model of all generators, for any depth from the first to the last.
    seed
        From which all seeds are derived, by `deepmuon_training.pipeline.seeds.step_seed`.
    fits
        How the generators of each architecture are fitted; in the file, a table by its name.

    Raises
    ------
    RefusedError
        If a value can't be.
    """

    architecture: str = "quantile"
    azimuth: Azimuth = "uniform"
    layers: Annotated[int, Range(0, 1000)] = 5
    layer_m: Annotated[float, Range(0, 10_000, above=True)] = 10.0
    material: str = "G4_WATER"
    density: Annotated[float | None, DENSITIES] = None
    muons: Annotated[int, Range(FEWEST_MUONS, _MOST_MUONS)] = 4_000_000
    muons_per_part: Annotated[int, Range(1, _MOST_MUONS)] = 500_000
    scored_muons: Annotated[int, Range(evaluate.FEWEST_MUONS, _MOST_MUONS)] = 20_000_000
    direct: bool = False
    family: bool = False
    seed: Annotated[int, Range(0, LARGEST_SEED)] = 1
    fits: Mapping[str, Any] = field(
        default_factory=lambda: {name: architecture(name).settings() for name in ARCHITECTURES}
    )

    def __post_init__(self) -> None:
        """Refuse what can't be."""
        if self.architecture not in ARCHITECTURES:
            raise RefusedError(f"architecture is {self.architecture!r}, and should be {' or '.join(ARCHITECTURES)}")
        check_ranges(self)
        kind = architecture(self.architecture)
        kind.check_azimuth(self.azimuth)
        if self.family and not (kind.makes_families and self.azimuth == "uniform" and self.layers):
            raise RefusedError(
                "family is true, which needs an architecture that makes families (quantile), a uniform azimuth, and "
                "1 layer at least"
            )

    @property
    def fit(self) -> Any:
        """How the generators of this pipeline are fitted."""
        return self.fits[self.architecture]


def read_pipeline_settings(path: Path) -> PipelineSettings:
    """Read the settings of a pipeline.

    Raises
    ------
    RefusedError
        If the file is no TOML, a key or value is none of these settings, or Geant4 knows no such material.
    """
    settings = settings_from(PipelineSettings(), read_table(path), str(path))
    try:
        check_material(settings.material, settings.density)
    except RefusedError as error:
        raise RefusedError(f"{path}: {error}") from error
    return settings
