"""Muons from a model: as columns, as a stream of chunks, or as a file."""

from __future__ import annotations

import collections.abc
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from itertools import chain, pairwise
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import FailedError, RefusedError, first_line
from deepmuon_runtime.formats.registry import output_format
from deepmuon_runtime.latents.philox import checked_seed, fill_latents, new_seed
from deepmuon_runtime.latents.poisson import poisson
from deepmuon_runtime.latents.shard import WHOLE_RUN, Shard
from deepmuon_runtime.model.metadata import LATENTS_PER_MUON, SPHERE, Model
from deepmuon_runtime.model.released import read_released, released_model
from deepmuon_runtime.muon_file.format import BYTES_PER_MUON, COLUMNS
from deepmuon_runtime.muons import MU_PLUS, Muons
from deepmuon_runtime.ordered_map import ordered_map
from deepmuon_runtime.physical import check_physical
from deepmuon_runtime.room import check_disk, check_memory

if TYPE_CHECKING:
    import onnxruntime

    from deepmuon_runtime.model.bound_run import BoundRun

__all__ = ["LARGEST_NUMBER", "Generator", "checked_numbers"]

LARGEST_NUMBER = 2**53
"""The most muons of one run."""

# Muons of one run of the network, about: what it works on stays in a CPU's cache; a GPU wants much at once.
BLOCK = {"cpu": 1 << 14, "cuda": 1 << 18}
PIECE = {"cpu": 1 << 17, "cuda": 1 << 18}  # muons of one task of a thread, and of one write, in whole blocks
TRIED = 5  # values of the latents, before the first muons: the ends, the middle, and two between

Outputs = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]  # energy, direction, charge


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

    def __init__(self, session: onnxruntime.InferenceSession, model: Model, device: str, threads: int) -> None:
        self.model = model
        self.device = device
        self.threads = threads
        self._session = session
        self._stream = model.stream
        self._block_draws = _block_draws(model, device)
        self._own = threading.local()  # each thread's memory for its runs

    @classmethod
    def open(
        cls,
        depth: float | None = None,
        architecture: str | None = None,
        *,
        file: str | Path | None = None,
        device: str = "auto",
        threads: int | None = None,
    ) -> Generator:
        """Open a released model by its depth, or any model that keeps the ONNX contract by its file.

        Parameters
        ----------
        depth
            Metres of water above the muons. Of a family, any number in its range; that of a file has its medium, and
            the depth that stands in it if left out.
        architecture
            "quantile" or "transformer"; the default one if left out.
        file
            An ONNX file, instead of a released model.
        device
            "cpu"; "cuda"; or "auto", which is CUDA where it can be had, else the CPU.
        threads
            How many blocks are made side by side; as many as the process may use if left out.

        Raises
        ------
        RefusedError
            If there is no such model or depth, it breaks the contract, or the device can't be had.
        """
        from deepmuon_runtime.model.opening import checked_model, load_model, read_file

        threads = _usable_processors() if threads is None else threads
        if not isinstance(threads, Integral) or threads < 1:
            raise RefusedError(f"{threads!r} threads can't make muons: 1 or more can")
        if file is not None:
            if architecture is not None:
                raise RefusedError("a model's file decides its architecture: give the file, and of a family a depth")
            name, contents = str(file), read_file(Path(file))
        else:
            if depth is None:
                raise RefusedError("which model? Give the depth of a released one, or the file of another")
            released = released_model(depth, architecture)
            name, contents = released.name, read_released(released)
            depth = depth if released.is_family else None
        contents, model = checked_model(contents, name, depth)
        if file is not None:
            cls._try_memory(contents, model)
        session, model, device = load_model(contents, model, device)
        generator = cls(session, model, device, threads)
        generator._try(TRIED)
        return generator

    def sample(self, n: int, seed: int | None = None, *, first: int = 0) -> Muons:
        """Return n muons as columns, all in memory.

        Parameters
        ----------
        n
            How many, 0 to 2^53.
        seed
            0 to 2^64 - 1; one from the operating system if left out.
        first
            Number of the first of them among the muons of the seed.

        Returns
        -------
        Muons [n]

        Raises
        ------
        RefusedError
            If n, `first`, their sum or the seed is out of range, or the memory does not hold n muons.
        FailedError
            If the model gives an unphysical muon.
        """
        numbers, seed = checked_numbers(n, first), _seed(seed)
        instead = "take them in chunks, or write a file"
        check_memory(len(numbers) * BYTES_PER_MUON, f"{n} muons", instead)
        try:
            muons = Muons.empty(len(numbers))
        except (MemoryError, ValueError) as error:
            raise RefusedError(f"{n} muons do not fit in memory: {instead}") from error

        def fill(part: range) -> None:
            self._fill(muons[part.start - numbers.start : part.stop - numbers.start], seed, part.start)

        for _ in ordered_map(fill, self._parts(numbers), self.threads):
            pass
        return muons

    def chunks(
        self, n: int, seed: int | None = None, *, first: int = 0
    ) -> collections.abc.Generator[Muons, None, None]:
        """Yield n muons in pieces of about a hundred thousand, for those who stream.

        The memory needed does not grow with n. The pieces one after the other are `sample(n, seed, first=first)`.
        Whoever stops before the end should close the iterator (`contextlib.closing`), which stops the threads.

        Parameters
        ----------
        n, seed, first
            As for `sample`.

        Raises
        ------
        RefusedError, FailedError
            As `sample`.
        """
        numbers, seed = checked_numbers(n, first), _seed(seed)

        def chunk(part: range) -> Muons:
            muons = Muons.empty(len(part))
            self._fill(muons, seed, part.start)
            return muons

        return ordered_map(chunk, self._parts(numbers), self.threads)

    def write(
        self,
        path: str | Path,
        n: int,
        seed: int | None = None,
        *,
        shard: Shard = WHOLE_RUN,
        format: str | None = None,
        overwrite: bool = False,
        progress: Callable[[int], object] | None = None,
        attributes: Mapping[str, object] | None = None,
    ) -> None:
        """Write n muons, or a shard of them, to a file, which appears under its name only when it is complete.

        Parameters
        ----------
        path
            The file; its folder must exist.
        n, seed
            As for `sample`; the file records the seed.
        shard
            Which part of the n muons. The shards of one seed, made on any machines, together are the n muons.
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
            If n or the seed is out of range, `path` can't be written, or its disk is too small.
        FailedError
            If the model gives an unphysical muon, writing fails, or another process writes `path` meanwhile.
        """
        total, seed = len(checked_numbers(n)), _seed(seed)
        numbers = shard.numbers(total)
        form = output_format(path, format)
        folder = form.check_output(path, overwrite).parent
        check_disk(folder, len(numbers) * form.bytes_per_muon(COLUMNS), f"{len(numbers):,} muons")
        described = {**self._attributes(seed, shard, total), **(attributes or {})}
        chunks = self.chunks(len(numbers), seed, first=numbers.start)
        with form.writer(path, described, overwrite) as writer, closing(chunks):
            for muons in chunks:
                writer.append(muons)
                if progress is not None:
                    progress(len(muons))

    def number_in_live_time(self, live_time: float, area: float, seed: int) -> int:
        """Draw the number of muons that cross a horizontal area: a Poisson number at the model's rate.

        Of a model whose muons cross a sphere, the area is that of its cross-section.

        Parameters
        ----------
        live_time
            Seconds.
        area
            Square metres.
        seed
            0 to 2^64 - 1; the number has random numbers of its own, apart from the muons of that seed.

        Raises
        ------
        RefusedError
            If the model does not know its rate, or the expected number is not above 0 and at most 2^53.
        """
        if self.model.rate_hz_per_m2 is None:
            raise RefusedError(f"{self.model.name} does not know its rate: give a number of muons")
        for number, meaning in ((live_time, "live time in seconds"), (area, "area in m2")):
            if not isinstance(number, Real):
                raise RefusedError(f"{number!r} is no {meaning}: a number is")
        mean = self.model.rate_hz_per_m2 * live_time * area
        if not 0 < mean <= LARGEST_NUMBER:
            raise RefusedError(
                f"{mean:g} muons are expected in {live_time:g} s on {area:g} m2, and should be 0 to 2^53"
            )
        return poisson(mean, checked_seed(seed), self._stream)

    def _attributes(self, seed: int, shard: Shard, total: int) -> dict[str, object]:
        model = self.model
        rates = {
            "rate_hz_per_m2": model.rate_hz_per_m2,
            "rate_uncertainty_hz_per_m2": model.rate_uncertainty_hz_per_m2,
        }
        return {
            "depth_m": model.depth_m,
            "medium": model.medium,
            "seed": np.uint64(seed),
            "first": shard.numbers(total).start,
            "total": total,
            "shard": str(shard),
            "model_sha256": model.sha256,
            "architecture": model.architecture,
            "device": self.device,
            **{name: rate for name, rate in rates.items() if rate is not None},
            **({"surface": model.surface} if model.surface == SPHERE else {}),
        }

    def _parts(self, numbers: range) -> Iterator[range]:
        """Cut the numbers of muons at multiples of many blocks; the first part makes a file's chunks: no small one."""
        block = self._block_draws * self.model.muons_per_draw
        size = -(-PIECE[self.device] // block) * block
        first_end = -(-numbers.start // size) * size + size
        edges = chain([numbers.start], range(first_end, numbers.stop, size), [numbers.stop])
        return (range(start, stop) for start, stop in pairwise(edges) if numbers)

    def _fill(self, muons: Muons, seed: int, first: int) -> None:
        """Make the muons from number `first` on, block by block."""
        size = self._block_draws * self.model.muons_per_draw
        run = self._thread_run()
        done = 0
        while done < len(muons):
            block, skipped = divmod(first + done, size)
            part = muons[done : done + size - skipped]
            fill_latents(run.latent, seed, block * self._block_draws, self._stream)
            self._run(run, skipped, part)
            check_physical(part, self.model.energy_min_gev, self.model.energy_max_gev, first + done)
            done += len(part)

    def _thread_run(self) -> BoundRun:
        """Return the run of blocks that belongs to this thread."""
        from deepmuon_runtime.model.bound_run import BoundRun

        if not hasattr(self._own, "run"):
            muons = self._block_draws * self.model.muons_per_draw
            self._own.run = BoundRun(self._session, self.device, self._block_draws, self.model.latent_size, muons)
        run: BoundRun = self._own.run
        return run

    def _run(self, run: Callable[[], Outputs], skipped: int, muons: Muons) -> None:
        """Run the model, leave out the first muons, and keep as many as asked for."""
        try:
            energy, direction, charge = run()
        except Exception as error:  # ONNX Runtime's own classes have no common base
            from deepmuon_runtime.model.trial import memory_asked

            reason = memory_asked(error) or first_line(error)
            raise FailedError(f"the model {self.model.name} failed: {reason}") from error
        kept = slice(skipped, skipped + len(muons))
        muons.kinetic_energy[:] = energy[kept]
        for axis, column in enumerate((muons.u, muons.v, muons.w)):
            column[:] = direction[kept, axis]
        np.multiply(charge[kept], np.int8(MU_PLUS), out=muons.pdg_id)

    @classmethod
    def _try_memory(cls, contents: bytes, model: Model) -> None:
        """Refuse a model of which a block of muons takes too much memory, before it is loaded for good."""
        from deepmuon_runtime.model.contract import check_signature
        from deepmuon_runtime.model.trial import open_for_trial, returning_memory

        session = open_for_trial(contents, model.name)
        check_signature(session, model)
        generator = cls(session, model, "cpu", threads=1)
        for draws in (TRIED, generator._block_draws):
            generator._try(draws, returning_memory())

    def _try(self, draws: int, options: onnxruntime.RunOptions | None = None) -> None:
        """Refuse a model that fails at the ends or in the middle of its latents, in so many draws."""
        values = np.resize(np.linspace(-1, 1, TRIED, dtype=np.float32), draws)
        latent = np.repeat(values[:, None], self.model.latent_size, axis=1)
        muons = Muons.empty(len(latent) * self.model.muons_per_draw)

        def run() -> Outputs:
            from deepmuon_runtime.model.contract import INPUT, OUTPUTS

            energy, direction, charge = self._session.run(OUTPUTS, {INPUT: latent}, options)
            if not len(energy) == len(direction) == len(charge) == len(muons):
                raise ValueError(
                    f"it gave {len(energy)} energies, {len(direction)} directions and {len(charge)} charges, "
                    f"and should give {len(muons)} each"
                )
            return energy, direction, charge

        try:
            self._run(run, 0, muons)
            check_physical(muons, self.model.energy_min_gev, self.model.energy_max_gev)
        except FailedError as error:
            raise RefusedError(f"{self.model.name} breaks the contract in a trial: {error}") from error


def _block_draws(model: Model, device: str) -> int:
    """Return how many draws make a block: of large ones, which each thread has in memory, as few as one."""
    size = max(model.muons_per_draw, model.latent_size // LATENTS_PER_MUON)
    # Multiples of 8 draws where they fit: a block then begins with a whole step of the random number generator.
    step = 8 if 8 * size <= BLOCK[device] else 1
    return -(-BLOCK[device] // (step * size)) * step


def _usable_processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def checked_numbers(n: float, first: float = 0) -> range:
    """Return the numbers of n muons from `first` on, or raise RefusedError where there are none."""
    for number, meaning in ((n, "number of muons"), (first, "number of a first muon")):
        if not isinstance(number, Real) or not 0 <= number <= LARGEST_NUMBER or number % 1 != 0:
            raise RefusedError(f"{number!r} is no {meaning}: a whole number from 0 to 2^53 is")
    if first + n > LARGEST_NUMBER:
        raise RefusedError(f"{n} muons from number {first} on end after number 2^53")
    return range(int(first), int(first) + int(n))


def _seed(seed: int | None) -> int:
    return new_seed() if seed is None else checked_seed(seed)
