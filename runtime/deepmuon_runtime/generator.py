"""Muons from a model: as columns, as a stream of chunks, or as a file."""

from __future__ import annotations

import collections.abc
import math
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from itertools import chain, pairwise
from numbers import Integral, Real
from pathlib import Path
from typing import NamedTuple

import numpy as np

from deepmuon_runtime.cuts import NO_CUTS, Cuts
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.formats.registry import output_format
from deepmuon_runtime.latents.arrivals import Arrivals
from deepmuon_runtime.latents.philox import checked_seed, new_seed
from deepmuon_runtime.latents.shard import WHOLE_RUN, Shard
from deepmuon_runtime.model.metadata import SPHERE
from deepmuon_runtime.model.released import read_released, released_model
from deepmuon_runtime.muon_file.format import COLUMNS, OPTIONAL_COLUMNS, PLACE, bytes_per_muon
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.ordered_map import ordered_map
from deepmuon_runtime.room import check_disk, check_memory
from deepmuon_runtime.sampling.numbers import checked_numbers
from deepmuon_runtime.sampling.selection import Rate, Selection
from deepmuon_runtime.sampling.surfaces import Surfaces
from deepmuon_runtime.targets.target import Target

__all__ = ["Generator"]

MOST_EXPECTED = 1e12
"""The most muons that a live time may be expected to give."""

# One copies to the computer's memory while the other's muons are made. An H200 gave 1,745 million muons a second
# by two, 1,114 by one, 1,316 by four and 825 by eight.
THREADS_OF_A_GPU = 2
RARE = 1e-6  # share of the muons, below which cuts are said to be narrow


class Generator:
    """A model that is ready to give muons: open one by `Generator.open`.

    Muon number i of a seed is the same whatever the number of muons, threads and chunks: bit by bit on one
    type of CPU, and to float32 rounding between types of CPU, or CPU and CUDA. So a shorter run is the
    beginning of a longer one. To that end the model always runs on whole blocks of draws that begin at
    multiples of their size. Two models have nothing in common at one seed: each has a stream of its own.

    Attributes
    ----------
    model : Model
        What the model says of itself.
    device : str
        Where it runs, "cpu" or "cuda".
    threads : int
        How many blocks are made side by side.

    Examples
    --------
    >>> from deepmuon_runtime import Generator
    >>> muons = Generator.open(depth=10).sample(1000, seed=1)
    >>> len(muons), bool((muons.w < 0).all())
    (1000, True)
    """

    def __init__(self, surfaces: Surfaces, threads: int) -> None:
        self.model = surfaces.own.model
        self.device = surfaces.own.device
        self.threads = threads
        self._surfaces = surfaces
        self._selections: dict[tuple[Cuts, Target | None], Selection] = {}

    @classmethod
    def open(
        cls,
        depth: float | None = None,
        architecture: str | None = None,
        *,
        flux: str | None = None,
        medium: str | None = None,
        file: str | Path | None = None,
        device: str = "auto",
        threads: int | None = None,
    ) -> Generator:
        """Open a released model by its depth, or any model that keeps the ONNX contract by its file.

        Parameters
        ----------
        depth
            Metres of the medium above the muons. Of a family, any number in its range; of a file's, the depth that
            stands in it if left out.
        architecture
            "quantile" or "transformer"; the default one if left out.
        flux
            At sea level: "cry", or "measured", which is fitted to measurements; "cry" if left out.
        medium
            Above the muons: "water", or "rock", the standard one of 2.65 g/cm3; "water" if left out.
        file
            An ONNX file, instead of a released model.
        device
            "cpu"; "cuda"; or "auto", which is CUDA where it can be had, else the CPU.
        threads
            How many blocks are made side by side; if left out, as many as the process may use, and 2 on a GPU.

        Raises
        ------
        RefusedError
            If there is no such model or depth, it breaks the contract, or the device can't be had.
        """
        from deepmuon_runtime.model.opening import read_file

        if threads is not None and (not isinstance(threads, Integral) or threads < 1):
            raise RefusedError(f"{threads!r} threads can't make muons: 1 or more can")
        if file is not None:
            for name, chosen in {"architecture": architecture, "flux": flux, "medium": medium}.items():
                if chosen is not None:
                    raise RefusedError(f"a model's file decides its {name}: give the file, and of a family a depth")
            name, contents = str(file), read_file(Path(file))
        else:
            if depth is None:
                raise RefusedError("which model? Give the depth of a released one, or the file of another")
            released = released_model(depth, architecture, flux, medium)
            name, contents = released.name, read_released(released)
            depth = depth if released.is_family else None
        surfaces = Surfaces(contents, name, depth, device, is_stranger=file is not None)
        if threads is None:
            threads = THREADS_OF_A_GPU if surfaces.own.device == "cuda" else _usable_processors()
        return cls(surfaces, threads)

    def sample(
        self,
        n: int | None = None,
        seed: int | None = None,
        *,
        first: int = 0,
        cuts: Cuts = NO_CUTS,
        target: Target | None = None,
        live_time: float | None = None,
        area: float | None = None,
        on_device: bool = False,
    ) -> Muons:
        """Return n muons, or those of a live time, as columns, all in memory.

        Parameters
        ----------
        n
            How many, 0 to 2^53.
        seed
            0 to 2^64 - 1; one from the operating system if left out.
        first
            Number of the first of them among the muons of the seed.
        cuts
            Bounds of energy and zenith angle; all n muons are within.
        target
            What all n muons hit: they then have places. A body needs the flux through a sphere, which families have.
        live_time
            Seconds, instead of n: the muons that come in this time, a Poisson number, each with its time.
        area
            With it, the horizontal area in m2 that they cross; a target has its own.
        on_device
            Whether the columns are CuPy's arrays in the GPU's memory, of a generator on CUDA. torch and JAX take them
            without a copy (DLPack). They are made there, unless a body of one's own does not take CuPy's arrays.

        Returns
        -------
        Muons [n]

        Raises
        ------
        RefusedError
            If n, `first`, their sum or the seed is out of range, the memory does not hold n muons, there are none
            of these cuts and this target, or they are to be on a GPU and can't.
        FailedError
            If the model gives an unphysical muon.
        """
        run = self._run(n, seed, first, cuts, target, live_time, area)
        return self._sample_on_device(run) if on_device else self._sample(run)

    def chunks(
        self,
        n: int | None = None,
        seed: int | None = None,
        *,
        first: int = 0,
        cuts: Cuts = NO_CUTS,
        target: Target | None = None,
        live_time: float | None = None,
        area: float | None = None,
    ) -> collections.abc.Generator[Muons, None, None]:
        """Yield the muons of `sample` in pieces of a hundred thousand or fewer, for those who stream.

        The memory needed does not grow with n. The pieces one after the other are `sample(n, seed, first=first)`.
        Whoever stops before the end should close the iterator (`contextlib.closing`), which stops the threads.

        Parameters
        ----------
        n, seed, first, cuts, target, live_time, area
            As for `sample`.

        Raises
        ------
        RefusedError, FailedError
            As `sample`.
        """
        return self._chunks(self._run(n, seed, first, cuts, target, live_time, area), spare=collections.deque())

    def write(
        self,
        path: str | Path,
        n: int | None = None,
        seed: int | None = None,
        *,
        shard: Shard = WHOLE_RUN,
        cuts: Cuts = NO_CUTS,
        target: Target | None = None,
        live_time: float | None = None,
        area: float | None = None,
        format: str | None = None,
        overwrite: bool = False,
        progress: Callable[[int], object] | None = None,
        attributes: Mapping[str, object] | None = None,
    ) -> None:
        """Write the muons of `sample`, or a shard of them, to a file, which appears only when it is complete.

        Parameters
        ----------
        path
            The file; its folder must exist.
        n, seed, cuts, target, live_time, area
            As for `sample`; the file records them.
        shard
            Which part of the muons. The shards of one seed, made on any machines, together are all.
        format
            A name of `formats.registry.FORMATS`: "h5", "mcpl", "mcpl.gz", "root", "csv" or "csv.gz". What the end of
            the file's name says if left out, and HDF5 if that says nothing.
        overwrite
            Whether an existing file may be replaced.
        progress
            Called after each piece with the number of muons written since the last call.
        attributes
            What the file says beside what a generator always says.

        Raises
        ------
        RefusedError
            As `sample`, or if `path` can't be written, or its disk is too small.
        FailedError
            If the model gives an unphysical muon, writing fails, or another process writes `path` meanwhile.
        """
        form = output_format(path, format)
        folder = form.check_output(path, overwrite).parent
        whole = self._run(n, seed, 0, cuts, target, live_time, area)
        run = whole._replace(numbers=shard.numbers(len(whole.numbers)))
        check_disk(folder, len(run.numbers) * form.bytes_per_muon(run.columns), f"{len(run.numbers):,} muons")
        described = {
            **self._attributes(run, shard, len(whole.numbers)),
            **({} if live_time is None else {"live_time_s": live_time}),
            **({} if area is None else {"area_m2": area}),
            **(attributes or {}),
        }
        optional = set(run.columns) - set(COLUMNS)
        spare: collections.deque[Muons] = collections.deque()
        chunks = self._chunks(run, spare)
        with form.writer(path, described, overwrite, optional=optional) as writer, closing(chunks):
            for muons in chunks:
                writer.append(muons)
                spare.append(muons)
                if progress is not None:
                    progress(len(muons))

    def rate(self, *, cuts: Cuts = NO_CUTS, target: Target | None = None) -> Rate | None:
        """Return how many muons come a second, that cuts keep and that hit a target.

        By a fixed integration: it is the same each time, whatever has been sampled.

        Parameters
        ----------
        cuts, target
            As for `sample`.

        Returns
        -------
        Rate, that of a m2 of the model's surface where there is no target; None where the model does not know its own.

        Raises
        ------
        RefusedError
            If there are no such muons.
        """
        return self._selection(cuts, target).rate

    def fraction_kept(self, cuts: Cuts, target: Target | None = None) -> float:
        """Return the share of all muons, of those that hit the target where there is one, that cuts keep."""
        return self._selection(cuts, target).share

    def number_in_live_time(
        self,
        live_time: float,
        area: float | None = None,
        seed: int = 0,
        *,
        cuts: Cuts = NO_CUTS,
        target: Target | None = None,
    ) -> int:
        """Return how many muons come in a live time: a Poisson number at their rate.

        Parameters
        ----------
        live_time
            Seconds.
        area
            Square metres of a horizontal plane, of a sphere those of its cross-section; none with a target.
        seed
            0 to 2^64 - 1; the number has random numbers of its own, apart from the muons of that seed.
        cuts, target
            As for `sample`.

        Raises
        ------
        RefusedError
            If the model does not know its rate, or the expected number is not above 0 and at most 10^12.
        """
        return self._arrivals(self._selection(cuts, target), live_time, area, checked_seed(seed)).count

    def _run(
        self,
        n: int | None,
        seed: int | None,
        first: int,
        cuts: Cuts,
        target: Target | None,
        live_time: float | None,
        area: float | None,
    ) -> _Run:
        """Return what is asked for, in one."""
        seed = new_seed() if seed is None else checked_seed(seed)
        if live_time is None:
            if area is not None:
                raise RefusedError("an area goes with a live time: give it, or leave out the area")
            numbers = checked_numbers(n, first)
            return _Run(self._selection(cuts, target), numbers, seed, None, threading.Event())
        if n is not None or first != 0:
            raise RefusedError("the live time decides the number of muons: leave out n and first")
        selection = self._selection(cuts, target)
        arrivals = self._arrivals(selection, live_time, area, seed)
        return _Run(selection, range(arrivals.count), seed, arrivals, threading.Event())

    def _selection(self, cuts: Cuts, target: Target | None) -> Selection:
        try:
            known = self._selections.get((cuts, target))
        except TypeError as error:
            raise RefusedError(f"{target!r} is no target: it is not hashable, as a frozen dataclass is") from error
        if known is not None:
            return known
        if not isinstance(cuts, Cuts):
            raise RefusedError(f"{cuts!r} are no cuts: give for instance Cuts(energy_min=1)")
        if target is not None and not isinstance(target, Target):
            raise RefusedError(f"{target!r} is no target: give for instance Box(4, 4, 3)")
        selection = Selection(self._surfaces.of(target), cuts, target)
        selection.warn_if_rarer_than(RARE)
        if target is not None:
            self._surfaces.warn_of_height(target)
        self._selections[cuts, target] = selection
        return selection

    def _arrivals(self, selection: Selection, live_time: float, area: float | None, seed: int) -> Arrivals:
        if selection.rate is None:
            raise RefusedError(f"{self.model.name} does not know its rate: give a number of muons")
        if selection.target is not None and area is not None:
            raise RefusedError(f"the {selection.target.name} has its own area: leave out the area")
        size = 1.0 if selection.target is not None else area
        if size is None:
            raise RefusedError("a live time goes with an area or a target: give one of them")
        for number, meaning in ((live_time, "live time in seconds"), (size, "area in m2")):
            if not isinstance(number, Real) or number < 0:
                raise RefusedError(f"{number!r} is no {meaning}: a number above 0 is")
        rate = selection.rate.hz * size
        if not 0 < rate * live_time <= MOST_EXPECTED or not math.isfinite(live_time):
            where = f"on {area:g} m2" if selection.target is None else f"on the {selection.target.name}"
            raise RefusedError(
                f"{rate * live_time:g} muons are expected in {live_time:g} s {where}, "
                "and should be above 0 and at most 10^12"
            )
        return Arrivals(rate, seed, selection.source.model.stream, float(live_time))

    def _sample(self, run: _Run) -> Muons:
        instead = "take them in chunks, or write a file"
        count = len(run.numbers)
        check_memory(count * bytes_per_muon(run.columns), f"{count} muons", instead)
        try:
            muons = run.empty(count)
        except (MemoryError, ValueError) as error:
            raise RefusedError(f"{count} muons do not fit in memory: {instead}") from error

        def fill(part: range) -> None:
            run.fill(muons[part.start - run.numbers.start : part.stop - run.numbers.start], part)

        for _ in ordered_map(fill, run.parts(), self.threads, run.stop.set):
            pass
        return muons

    def _sample_on_device(self, run: _Run) -> Muons:
        if self.device != "cuda":
            raise RefusedError("muons can stay on a GPU where they are made there: open the generator on device='cuda'")
        if run.selection.source.on_device is None:
            from deepmuon_runtime.cuda.maker import INSTALL

            raise RefusedError(f"columns in the GPU's memory are CuPy's arrays: {INSTALL}")
        from deepmuon_runtime.cuda.memory import copied, empty

        selection = run.selection
        if selection.on_device is None:
            return copied(self._sample(run))
        muons = empty(len(run.numbers), has_place=selection.target is not None, has_time=run.arrivals is not None)
        run.fill(muons, run.numbers)
        return muons

    def _chunks(self, run: _Run, spare: collections.deque[Muons]) -> collections.abc.Generator[Muons, None, None]:
        """Yield the muons of a run in pieces.

        Fresh memory costs a sixth of all the time that a piece takes, page by page: a caller who is done with a piece
        may put it into `spare`, and it is filled again.
        """

        def chunk(part: range) -> Muons:
            muons = _spare(spare, len(part)) or run.empty(len(part))
            run.fill(muons, part)
            return muons

        return ordered_map(chunk, run.parts(), self.threads, run.stop.set)

    def _attributes(self, run: _Run, shard: Shard, total: int) -> dict[str, object]:
        selection, target = run.selection, run.selection.target
        model = selection.source.model
        said: dict[str, object] = {
            "depth_m": model.depth_m,
            "medium": model.medium,
            "seed": np.uint64(run.seed),
            "first": run.numbers.start,
            "total": total,
            "shard": str(shard),
            "model_sha256": model.sha256,
            "architecture": model.architecture,
            "device": self.device,
        }
        if "flux" in model.metadata:
            said["flux"] = model.flux
        if model.surface == SPHERE:
            said["surface"] = SPHERE
        if selection.cuts:
            said |= {**selection.cuts.attributes, "fraction_kept": selection.share}
        if target is not None:
            said |= {"target": target.name, "target_size_m": [float(size) for size in target.size]}
        names = ("rate_hz_per_m2", "rate_uncertainty_hz_per_m2")
        if target is not None:
            names = ("target_rate_hz", "target_rate_uncertainty_hz")
        numbers = selection.rate or (None, None)
        return said | {name: number for name, number in zip(names, numbers, strict=True) if number is not None}


def _spare(pieces: collections.deque[Muons], length: int) -> Muons | None:
    """Take a piece of some length, if the next one is."""
    with suppress(IndexError):
        piece = pieces.pop()
        if len(piece) == length:
            return piece
    return None


class _StoppedError(Exception):
    """Nobody waits for the muons any more."""


class _Run(NamedTuple):
    """Muons that are asked for: which ones, and what they are made of."""

    selection: Selection
    numbers: range
    seed: int
    arrivals: Arrivals | None
    stop: threading.Event

    @property
    def columns(self) -> list[str]:
        """The names of their columns."""
        place = PLACE if self.selection.target is not None else ()
        time = [name for name in OPTIONAL_COLUMNS if name not in PLACE] if self.arrivals is not None else []
        return [*COLUMNS, *place, *time]

    def empty(self, n: int) -> Muons:
        """Return n muons whose columns are yet to be filled."""
        return self.selection.empty(n, has_time=self.arrivals is not None)

    def fill(self, muons: Muons, part: range) -> None:
        """Make some of them."""
        self.selection.fill(muons, self.seed, part.start, self._check_wanted)
        if self.arrivals is not None:
            assert muons.time is not None
            device = self.selection.on_device
            if device is None:
                muons.time[:] = self.arrivals.times(part)
            else:
                device.fill_times(muons.time, self.arrivals, part)

    def parts(self) -> Iterator[range]:
        """Cut the numbers of muons at multiples of many blocks; the first part makes a file's chunks: no small one."""
        numbers, size = self.numbers, self.selection.piece
        first_end = -(-numbers.start // size) * size + size
        edges = chain([numbers.start], range(first_end, numbers.stop, size), [numbers.stop])
        return (range(start, stop) for start, stop in pairwise(edges) if numbers)

    def _check_wanted(self) -> None:
        if self.stop.is_set():
            raise _StoppedError


def _usable_processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
