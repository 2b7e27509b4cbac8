"""The steps of a pipeline at one depth: fit, export, draw, carry through the slab below, score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from deepmuon_runtime import Generator, read_attributes
from deepmuon_runtime.files.whole import write_whole
from deepmuon_training.generators.family import family_of
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import FittedGenerator, export_fitted
from deepmuon_training.pipeline.seeds import step_seed
from deepmuon_training.pipeline.settings import PipelineSettings
from deepmuon_training.progress import progress_bar
from deepmuon_training.sample import read_sample
from deepmuon_training.scores.model_evaluation import evaluate_model
from deepmuon_training.transport.slab_file import transport_file

__all__ = ["Layer", "carry", "draw", "export", "family", "fit", "score"]


@dataclass(frozen=True)
class Layer:
    """The files of one depth.

    Parameters
    ----------
    number
        From 0 at the top.
    depth_m
        Metres of overburden.
    sample
        The muons that its generator learns.
    generator, model
        The generator, fitted and exported.
    carried
        The muons that are carried through the slab below: those that the generator draws, or `sample` itself where
        the pipeline is direct.
    held_out
        Muons to compare its generator with, if there are any.
    evaluation
        What came of that.
    """

    number: int
    depth_m: float
    sample: Path
    generator: Path
    model: Path
    carried: Path
    held_out: Path | None
    evaluation: Path

    def seed(self, settings: PipelineSettings, kind: str) -> int:
        """Return the seed of one of its steps."""
        return step_seed(settings.seed, kind, self.number)


def fit(layer: Layer, settings: PipelineSettings, folder: Path, progress: bool) -> None:
    """Fit a generator to the layer's sample, with checkpoints in a folder."""
    fitted = fit_generator(
        read_sample(layer.sample),
        settings.architecture,
        seed=layer.seed(settings, "fit"),
        settings=settings.fit,
        azimuth=settings.azimuth,
        checkpoint_folder=folder,
        progress=progress,
    )
    fitted.save(layer.generator)


def export(layer: Layer) -> None:
    """Write the fitted generator as an ONNX file."""
    export_fitted(FittedGenerator.load(layer.generator), layer.model)


def family(layers: Sequence[Layer], model: Path) -> None:
    """Write the generators of all layers as one ONNX file, for any depth between."""
    family_of([FittedGenerator.load(layer.generator) for layer in layers]).export(model)


def draw(layer: Layer, settings: PipelineSettings, progress: bool) -> None:
    """Draw muons from the layer's model; they are described as what its sample is, and what was done then."""
    seed = layer.seed(settings, "draw")
    learned = read_sample(layer.sample, 0, 0)
    layered = f", layered through {settings.architecture} generators"
    drawn = replace(learned, source=learned.source.removesuffix(layered) + layered).then(
        f"{settings.muons} muons drawn with seed {seed} from a {settings.architecture} generator, which was fitted to "
        f"{read_attributes(layer.sample)['count']} of these with seed {layer.seed(settings, 'fit')}"
    )
    with progress_bar(settings.muons, "draw", " muons", hidden=not progress) as bar:
        Generator.open(file=layer.model, device="cpu").write(
            layer.carried, settings.muons, seed, progress=bar.update, attributes=drawn.attributes
        )


def carry(layer: Layer, below: Layer, settings: PipelineSettings, folder: Path, progress: bool) -> None:
    """Carry muons to the layer below, in parts that are kept in a folder."""
    transport_file(
        layer.carried,
        below.sample,
        settings.layer_m,
        seed=layer.seed(settings, "transport"),
        muons_per_part=settings.muons_per_part,
        material=settings.material,
        density=settings.density,
        folder=folder,
        progress=progress,
    )


def score(layer: Layer, settings: PipelineSettings) -> None:
    """Compare the layer's model with held-out muons."""
    assert layer.held_out is not None
    evaluation = evaluate_model(
        layer.model,
        read_sample(layer.held_out),
        settings.scored_muons,
        seed=layer.seed(settings, "score"),
        unphysical_before_mapping=FittedGenerator.load(layer.generator).unphysical_before_mapping,
    )
    write_whole(layer.evaluation, evaluation.to_json().encode())
