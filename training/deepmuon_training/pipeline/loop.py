"""The loop of the paper: layer by layer from a sample's depth downwards, a generator for every depth.

Fit a generator, draw muons from it, carry them through a slab by Geant4, fit a generator to those that came through,
and so on; or, `direct`, carry on the muons that came through, with no network between. Every step ends with a file in
the folder of the run, which appears under its name only when it is complete: steps whose file is there are not done
again, so a run that was killed goes on when it is started again, and ends with the same muons and models as an
undisturbed one. A fit goes on from its last checkpoint, a transport from its last part; what else a step does takes
seconds to minutes, and starts anew.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from deepmuon_runtime import RefusedError, read_attributes
from deepmuon_training.generators.fit import check_sample
from deepmuon_training.pipeline import layer as layer_steps
from deepmuon_training.pipeline.folder import run_folder
from deepmuon_training.pipeline.layer import Layer
from deepmuon_training.pipeline.settings import PipelineSettings
from deepmuon_training.pipeline.step import Step, run_steps
from deepmuon_training.sample import read_sample
from deepmuon_training.scores.evaluate import FEWEST_MUONS
from deepmuon_training.transport.material import check_material, medium

__all__ = ["Pipeline", "plan"]


@dataclass(frozen=True)
class Pipeline:
    """A run of the loop, planned by `plan`.

    Parameters
    ----------
    settings
        Of the run.
    folder
        For its files.
    layers
        From top to bottom.
    steps
        In order.
    """

    settings: PipelineSettings
    folder: Path
    layers: tuple[Layer, ...]
    steps: tuple[Step, ...]

    def run(self, say: Callable[[str], object], progress: bool = True) -> None:
        """Do the steps that are not done.

        Parameters
        ----------
        say
            Is told the plan, and how it goes, a line at a time.
        progress
            Whether to show progress bars on stderr.

        Raises
        ------
        RefusedError
            If the folder is of another run, or in use; before anything is done.
        FailedError
            If a step fails.
        """
        with run_folder(self.folder, self.settings, self.layers[0].sample):
            run_steps(self.steps, say, progress)


def plan(settings: PipelineSettings, sample: Path, folder: Path, held_out: Sequence[Path] = ()) -> Pipeline:
    """Plan the run of a pipeline; nothing is written.

    Parameters
    ----------
    settings
        Of the run.
    sample
        Muon file, from whose depth the layers go down.
    folder
        For the files of the run: a new or empty one, or one of the same run, which then goes on.
    held_out
        Muon files to compare the generators with, each at the depth of one of the layers.

    Raises
    ------
    RefusedError
        If the sample can't be learned or carried on, the material is unknown, or held-out muons are too few or at no
        layer's depth.
    """
    top = read_sample(sample)
    check_sample(top)
    overburden = medium(settings.material, settings.density)
    if settings.layers:
        check_material(settings.material, settings.density)
        if top.depth_m > 0 and top.medium != overburden:
            raise RefusedError(f"muons under {top.depth_m:g} m of {top.medium} can't go on in {overburden}")
    depths = [top.depth_m + number * settings.layer_m for number in range(settings.layers + 1)]
    by_depth = _by_depth(held_out, depths)
    layers: list[Layer] = []
    for number, depth in enumerate(depths):
        name = f"{depth:g}m"
        learned = folder / f"muons-{name}.h5" if number else sample
        layers.append(
            Layer(
                number,
                depth,
                sample=learned,
                generator=folder / f"{settings.architecture}-{name}.pt",
                model=folder / f"{settings.architecture}-{name}.onnx",
                carried=learned if settings.direct else folder / f"drawn-{name}.h5",
                held_out=by_depth.get(number),
                evaluation=folder / f"evaluation-{name}.json",
            )
        )
    steps = [
        step for layer, below in zip_longest(layers, layers[1:]) for step in _steps(settings, layer, below, len(top))
    ]
    if settings.family:
        model = folder / f"{settings.architecture}-family.onnx"
        what = f"{len(layers)} generators, {layers[0].depth_m:g} to {layers[-1].depth_m:g} m"
        steps.append(Step("family", what, model, lambda *_: layer_steps.family(layers, model)))
    return Pipeline(settings, folder, tuple(layers), tuple(steps))


def _by_depth(held_out: Sequence[Path], depths: Sequence[float]) -> dict[int, Path]:
    """Return held-out files by the number of their layer."""
    found: dict[int, Path] = {}
    for path in held_out:
        attributes = read_attributes(path)
        depth = float(attributes["depth_m"])
        numbers = [number for number, other in enumerate(depths) if math.isclose(depth, other, abs_tol=1e-9)]
        if not numbers:
            raise RefusedError(f"{path} has muons at {depth:g} m, and no layer ends there")
        if attributes["count"] < FEWEST_MUONS:
            raise RefusedError(f"{path} has {attributes['count']} muons: at least {FEWEST_MUONS} are needed to compare")
        if numbers[0] in found:
            raise RefusedError(
                f"{path} and {found[numbers[0]]} both have muons at {depth:g} m: give one for each depth"
            )
        found[numbers[0]] = path
    return found


def _steps(settings: PipelineSettings, layer: Layer, below: Layer | None, top: int) -> Iterator[Step]:
    """Yield the steps at one depth, and those to the one below; the sample has `top` muons."""
    learned = "what came through" if layer.number else f"{top:,} muons"
    yield Step(
        "fit",
        f"{learned} at {layer.depth_m:g} m",
        layer.generator,
        lambda saved, progress: layer_steps.fit(layer, settings, saved, progress),
    )
    yield Step("export", layer.generator.name, layer.model, lambda *_: layer_steps.export(layer))
    if layer.held_out is not None:
        yield Step(
            "score",
            f"{settings.scored_muons:,} muons against {layer.held_out}",
            layer.evaluation,
            lambda *_: layer_steps.score(layer, settings),
        )
    if below is None:
        return
    if not settings.direct:
        yield Step(
            "draw",
            f"{settings.muons:,} muons at {layer.depth_m:g} m",
            layer.carried,
            lambda _, progress: layer_steps.draw(layer, settings, progress),
        )
    yield Step(
        "transport",
        f"{layer.carried.name} through {settings.layer_m:g} m of {medium(settings.material, settings.density)}",
        below.sample,
        lambda saved, progress: layer_steps.carry(layer, below, settings, saved, progress),
    )
