"""Work in steps, each of which ends with a file: what is there, and is what was written, is not done again."""

from __future__ import annotations

import shutil
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_training.pipeline import checksums

__all__ = ["Step", "run_steps"]


@dataclass(frozen=True)
class Step:
    """One step of a pipeline.

    Parameters
    ----------
    kind
        fit, export, draw, transport, score or family.
    what
        It works on, in words.
    result
        The file with which it ends.
    make
        Makes that, given a folder for what is saved on the way, and whether to show progress bars.
    """

    kind: str
    what: str
    result: Path
    make: Callable[[Path, bool], None]

    @property
    def is_done(self) -> bool:
        """Whether its result is there."""
        return self.result.exists()

    def run(self, progress: bool) -> None:
        """Make the result, unless it is there, and remove what was saved on the way.

        Raises
        ------
        FailedError
            If that fails.
        """
        saved = self.result.with_name(f"unfinished-{self.result.name}")
        if not self.is_done:
            saved.mkdir(exist_ok=True)
            try:
                self.make(saved, progress)
            except RefusedError as error:  # by then the user's input is not at fault
                raise FailedError(f"{self.kind} {self.what}: {error}") from error
            checksums.record(self.result)
        shutil.rmtree(saved, ignore_errors=True)


def run_steps(steps: Sequence[Step], say: Callable[[str], object], progress: bool = True) -> None:
    """Do the steps that are not done, in their order.

    Parameters
    ----------
    steps
        Those that are done are passed over.
    say
        Is told the plan, and how it goes, a line at a time.
    progress
        Whether to show progress bars on stderr.

    Raises
    ------
    RefusedError
        If a file that is there is not what was written; before anything is done.
    FailedError
        If a step fails.
    """
    for step in steps:
        if step.is_done:
            checksums.check(step.result)
    for number, step in enumerate(steps, 1):
        say(f"{number:>3}  {'done' if step.is_done else '':4}  {step.result.name:26}  {step.kind} {step.what}")
    seconds: dict[str, list[float]] = defaultdict(list)
    for number, step in enumerate(steps, 1):
        was_done, started = step.is_done, time.monotonic()
        if not was_done:
            say(f"{number} of {len(steps)}: {step.kind} {step.what}")
        step.run(progress)
        if not was_done:
            seconds[step.kind].append(time.monotonic() - started)
            say(f"{step.result.name} made in {_duration(seconds[step.kind][-1])}{_left(steps, seconds)}")


def _left(steps: Sequence[Step], seconds: dict[str, list[float]]) -> str:
    """Say how long the rest will take, where a step of each kind that is left has been timed."""
    kinds = [step.kind for step in steps if not step.is_done]
    if not kinds or not seconds.keys() >= set(kinds):
        return ""
    return f"; about {_duration(sum(fmean(seconds[kind]) for kind in kinds))} left"


def _duration(seconds: float) -> str:
    minutes, hours = round(seconds / 60), int(seconds / 3600)
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 100 else f"{hours} h {minutes - 60 * hours} min"
