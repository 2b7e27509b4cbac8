"""`deepmuon-gen`: muons from a model to a file."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click
from click.core import ParameterSource

from deepmuon_cli.options.completion import architectures, depths, devices, fluxes, media
from deepmuon_cli.options.formats import FORMAT
from deepmuon_cli.options.mistyped import HelpfulCommand
from deepmuon_cli.options.quantities import (
    degrees,
    depth_metres,
    gev,
    muon_number,
    seconds,
    seed_number,
    shard_number,
    size,
    square_metres,
    thread_number,
)
from deepmuon_cli.process.ending import run

if TYPE_CHECKING:  # the libraries are imported when they are needed: --help is answered at once
    from deepmuon_runtime import Rate, Shard, Target

__all__ = ["gen", "main"]

NAME = "deepmuon-gen"
FILE = click.Path(path_type=Path)
BETWEEN_LINES = 30.0  # s, of progress in a log

CHARGE = "muons of both charges are written: keep those you want when you read the file"
MATERIAL = "write --medium water or --medium rock; deepmuon-train transport takes muons through other materials"
DENSITY = "water has 1 g/cm3 and rock 2.65; deepmuon-train source makes muons under others, by --density"
LEADS = {
    **dict.fromkeys(("--emin", "--min-energy"), "write --energy-min GEV"),
    **dict.fromkeys(("--emax", "--max-energy"), "write --energy-max GEV"),
    **dict.fromkeys(("--min-zenith", "--theta-min"), "write --zenith-min DEGREES"),
    **dict.fromkeys(("--max-zenith", "--theta-max"), "write --zenith-max DEGREES"),
    "--energy": "write --energy-min GEV and --energy-max GEV",
    "--zenith": "write --zenith-min DEGREES and --zenith-max DEGREES",
    "--charge": CHARGE,
    **dict.fromkeys(("--target", "--surface", "--detector"), "write --plane, --sphere, --box or --cylinder"),
    "--can": "write --cylinder RADIUS HEIGHT",
    "--material": MATERIAL,
    "--density": DENSITY,
    **{f"--{name}": f"write --medium {name}" for name in ("water", "rock")},
    **{f"--{name}": f"write --flux {name}" for name in ("cry", "measured")},
    **dict.fromkeys(("--overburden", "--mwe"), "write --depth METRES, of --medium water or --medium rock"),
    **dict.fromkeys(
        ("--csv", "--text", "--root", "--mcpl"), "the end of the file's name says its format: -o muons.mcpl"
    ),
    **dict.fromkeys(("--gpu", "--cuda"), "write --device cuda"),
    **dict.fromkeys(("--time", "--exposure", "--duration"), "write --live-time SECONDS, with --area M2 or a target"),
    **dict.fromkeys(("-N", "--n", "--muons", "--events", "--count", "--size"), "write -n 1e6"),
    **dict.fromkeys(("--cores", "--jobs", "-j", "-t"), "write --threads"),
    **dict.fromkeys(("--file", "--to"), "write -o muons.h5"),
    "-d": "write --depth",
    "-m": "write --model FILE",
    "-s": "write --seed",
    "-f": "write --overwrite",
    "--force": "write --overwrite",
    "-v": "write --version",
    "-l": "write --list",
}
"""What to say to options that users try."""

VALUES = {
    "--depth": r"[0-9.,]+ ?m?",
    "-n": r"[0-9.,_]+([eE][0-9]+)?",
    "--model": r".*\.onnx",
    "--architecture": r"quantile|transformer",
    "--flux": r"cry|measured",
    "--medium": r"water|rock",
    "-o": r".*\.(h5|hdf5|mcpl|csv|root|txt)(\.gz)?",
}
"""What a word looks like whose option was forgotten."""

CUTS = ("energy_min", "energy_max", "zenith_min", "zenith_max")
TARGETS = ("plane", "sphere", "box", "cylinder")
WORTH_A_GPU = 100_000_000
"""Muons of a quantile model, above which a file is ready sooner by a GPU: to start one takes a second, and then writing
is the limit. 16 cores wrote so many in 2.3 s, an H200 beside them in 2.9."""

RECORDED = (
    *("depth", "architecture", "flux", "medium", "number", "live_time", "area", *CUTS, *TARGETS),
    *("seed", "shard", "device", "threads"),
)
"""The options that a file records: numbers and names of ours. Names of files are not: they could hold a secret."""


@click.command(
    name=NAME,
    cls=HelpfulCommand,
    leads=LEADS,
    values=VALUES,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.option(
    "--depth",
    type=depth_metres,
    metavar="METRES",
    shell_complete=depths,
    help="Metres of the medium above the muons: any number in the range of a family (see --list).",
)
@click.option(
    "--flux",
    metavar="NAME",
    shell_complete=fluxes,
    help="At sea level: cry (the default), or measured, fitted to measurements.",
)
@click.option(
    "--medium",
    metavar="NAME",
    shell_complete=media,
    help="Above the muons: water (the default) or rock, the standard one of 2.65 g/cm3.",
)
@click.option(
    "--architecture",
    metavar="NAME",
    shell_complete=architectures,
    help="quantile or transformer; the better one if left out.",
)
@click.option("--model", type=FILE, metavar="FILE", help="Your own ONNX model; of a family with --depth.")
@click.option("-n", "--number", type=muon_number, metavar="NUMBER", help="How many muons: 1e7, 10_000_000.")
@click.option(
    "--live-time",
    type=seconds,
    metavar="SECONDS",
    help="Instead of -n: the muons that come in this time, a Poisson number, each with its time.",
)
@click.option("--area", type=square_metres, metavar="M2", help="With --live-time and no target: the horizontal area.")
@click.option("--energy-min", type=gev, metavar="GEV", help="Lowest kinetic energy.")
@click.option("--energy-max", type=gev, metavar="GEV", help="Highest kinetic energy.")
@click.option("--zenith-min", type=degrees, metavar="DEGREES", help="Smallest zenith angle: 0 is from straight above.")
@click.option("--zenith-max", type=degrees, metavar="DEGREES", help="Largest zenith angle, to 90.")
@click.option(
    "--plane", type=size, nargs=2, metavar="X Y", help="Put all muons on a horizontal rectangle of these metres."
)
@click.option("--sphere", type=size, metavar="R", help="Send all muons into a sphere of this radius.")
@click.option("--box", type=size, nargs=3, metavar="X Y Z", help="Send all muons into a box of these widths, z up.")
@click.option(
    "--cylinder", type=size, nargs=2, metavar="R H", help="The same of an upright cylinder, radius and height."
)
@click.option("-o", "--output", type=FILE, metavar="FILE", help="The file to be written.")
@click.option("--format", "form", type=FORMAT, help="Of the file; what the end of its name says if left out, or HDF5.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("--seed", type=seed_number, metavar="SEED", help="0 to 2^64 - 1; a new one if left out.")
@click.option(
    "--shard",
    type=shard_number,
    metavar="I/K",
    help="Only part I of K, from 1, of the muons; --seed must be stated, the same for all parts.",
)
@click.option(
    "--device",
    default="auto",
    metavar="NAME",
    shell_complete=devices,
    help="cpu, cuda, or auto (the default): cuda if it can be had and is faster for so many muons.",
)
@click.option(
    "--threads",
    type=thread_number,
    metavar="NUMBER",
    help="Computing side by side; if left out, as many as may be used, and 2 on a GPU.",
)
@click.option("-q", "--quiet", is_flag=True, help="No progress bar and no closing line.")
@click.option("--list", "list_only", is_flag=True, help="List the released models.")
@click.version_option(package_name="deepmuon-runtime", prog_name=NAME, message="%(prog)s %(version)s")
@click.pass_context
def gen(
    context: click.Context,
    depth: float | None,
    flux: str | None,
    medium: str | None,
    architecture: str | None,
    model: Path | None,
    number: int | None,
    live_time: float | None,
    area: float | None,
    energy_min: float | None,
    energy_max: float | None,
    zenith_min: float | None,
    zenith_max: float | None,
    plane: tuple[float, ...] | None,
    sphere: float | None,
    box: tuple[float, ...] | None,
    cylinder: tuple[float, ...] | None,
    output: Path | None,
    form: str | None,
    overwrite: bool,
    seed: int | None,
    shard: Shard | None,
    device: str,
    threads: int | None,
    quiet: bool,
    list_only: bool,
) -> None:
    """Write cosmic-ray muons to a file: HDF5 (.h5), or .mcpl, .mcpl.gz, .root, .csv or .csv.gz by the end of its name.

    The muons cross a horizontal plane downwards, at sea level (--depth 0), under water or rock, or enter a body:
    kinetic energy in GeV, direction of motion (u, v, w) with z up, and pdg_id, 13 for mu- and -13 for mu+. With a
    target they have places (x, y, z) in metres from its centre, with --live-time a time in seconds.

    Ten million muons ten metres under water:

    \b
        deepmuon-gen --depth 10 -n 1e7 -o muons.h5

    The muons that cross 4 m2 at sea level in one hour, the same ones whenever it is run:

    \b
        deepmuon-gen --depth 0 --live-time 3600 --area 4 --seed 1 -o hour.h5

    Those that hit a box of 4 m x 4 m x 3 m ten metres under water in one minute, each with the place where it
    enters and its time; a family of models is needed for a body:

    \b
        deepmuon-gen --depth 10 --box 4 4 3 --live-time 60 -o tank.h5

    Those of the measured flux that cross 100 m2 under a kilometre of rock in a day:

    \b
        deepmuon-gen --flux measured --medium rock --depth 1000 --live-time 86400 --area 100 -o day.h5

    Those of 10 GeV and more that come from 60 to 90 degrees:

    \b
        deepmuon-gen --depth 0 --energy-min 10 --zenith-min 60 -n 1e5 -o slanting.h5

    The first of 100 parts of ten billion muons, which 100 jobs of a batch farm make:

    \b
        deepmuon-gen --depth 10 -n 1e10 --seed 1 --shard 1/100 -o muons-1.h5

    And in Python:

    \b
        import h5py
        with h5py.File("muons.h5") as file:
            energy = file["muons/kinetic_energy"][:]     # GeV
            live_time = file["muons"].attrs["live_time_s_m2"]

    A seed gives the same muons for any -n and --threads: a shorter run is the beginning of a longer one. The
    output appears under its name only when it is complete. Exit codes: 0 done, 1 failed while running,
    2 refused before anything was written, 129, 130 and 143 stopped by SIGHUP, Ctrl-C and SIGTERM.
    """  # noqa: D301 - click looks for the character \b
    started = time.perf_counter()
    if list_only:
        from deepmuon_cli.listing import listing

        for line in listing():
            click.echo(line)
        return
    _check_model_options(depth, model, {"architecture": architecture, "flux": flux, "medium": medium})
    if model is None:
        _check_released(depth, architecture, flux, medium)
    sizes = {"plane": plane, "sphere": None if sphere is None else (sphere,), "box": box, "cylinder": cylinder}
    given = {name: numbers for name, numbers in sizes.items() if numbers is not None}
    _check_target_options(given)
    _check_number_options(number, live_time, area, has_target=bool(given))
    if shard is not None and seed is None:
        raise click.UsageError("--shard needs a --seed, the same for all shards: without it each would have its own")
    if output is None:
        raise click.UsageError("where to? Give the name of a file: -o muons.h5")

    from deepmuon_runtime import Cuts, Generator, new_seed
    from deepmuon_runtime.formats.registry import output_format
    from deepmuon_runtime.latents.shard import WHOLE_RUN
    from deepmuon_runtime.targets.by_name import target_of

    cuts = Cuts(energy_min, energy_max, zenith_min, zenith_max)
    target = next((target_of(name, numbers) for name, numbers in given.items()), None)
    output_format(output, form).check_output(output, overwrite, [] if model is None else [model])
    # Then a GPU would not have begun before the processor is done.
    is_quick = model is None and architecture in (None, "quantile") and number is not None and number <= WORTH_A_GPU
    generator = Generator.open(
        depth,
        architecture,
        flux=flux,
        medium=medium,
        file=model,
        device="cpu" if device == "auto" and is_quick else device,
        threads=threads,
    )
    seed = new_seed() if seed is None else seed
    total = number
    if live_time is not None:
        total = generator.number_in_live_time(live_time, area, seed, cuts=cuts, target=target)
    assert total is not None
    shard = shard or WHOLE_RUN
    count = len(shard.numbers(total))
    with _progress(count, hidden=quiet) as progress:
        generator.write(
            output,
            number,
            seed,
            shard=shard,
            cuts=cuts,
            target=target,
            live_time=live_time,
            area=area,
            format=form,
            overwrite=overwrite,
            progress=progress,
            attributes={"command_line": _command_line(context)},
        )
    if not quiet:
        rate = generator.rate(cuts=cuts, target=target)
        seconds = time.perf_counter() - started
        exposure = _exposure(count, rate, target, live_time, area)
        if live_time is not None and shard != WHOLE_RUN:
            exposure = f"shard {shard} of a {exposure}"
        facts = (f"{count:,} muons in {seconds:.2f} s", f"{count / seconds:,.0f} muons/s on {generator.device}")
        click.echo(f"{output}: {', '.join((*facts, exposure, f'seed {seed}'))}")


def main() -> NoReturn:
    """Run `deepmuon-gen`."""
    run(gen, NAME)


def _check_model_options(depth: float | None, model: Path | None, released: Mapping[str, str | None]) -> None:
    if depth is None and model is None:
        raise click.UsageError("which muons? Give --depth METRES (--list shows the depths there are), or --model FILE")
    for name, chosen in released.items():
        if model is not None and chosen is not None:
            raise click.UsageError(f"--model goes without --{name}: the file has its own")


def _check_released(depth: float | None, architecture: str | None, flux: str | None, medium: str | None) -> None:
    """Refuse a depth that there is not before anything else is asked for."""
    from deepmuon_runtime.model.released import released_model

    if depth is not None:
        released_model(depth, architecture, flux, medium)


def _check_target_options(given: Mapping[str, object]) -> None:
    if len(given) > 1:
        names = " and ".join(f"--{name}" for name in given)
        raise click.UsageError(f"there is one target: {names} don't go together")


def _check_number_options(number: int | None, live_time: float | None, area: float | None, has_target: bool) -> None:
    if has_target and area is not None:
        raise click.UsageError("a target has its own area: leave out --area")
    if not has_target and (live_time is None) != (area is None):
        raise click.UsageError("--live-time and --area go together, where there is no target")
    if number is None and live_time is None:
        raise click.UsageError("how many muons? Give -n (as in -n 1e7), or --live-time and --area or a target")
    if number is not None and live_time is not None:
        raise click.UsageError("-n goes without --live-time: the live time decides the number")


def _command_line(context: click.Context) -> str:
    """Return the command with those of its options that may be recorded."""
    given = [
        (option.opts[-1], *_texts(context.params[option.name]))
        for option in context.command.params
        if option.name in RECORDED and context.get_parameter_source(option.name) == ParameterSource.COMMANDLINE
    ]
    return shlex.join([NAME, *chain.from_iterable(given)])


def _texts(value: object) -> list[str]:
    return [str(part) for part in (value if isinstance(value, tuple) else [value])]


@contextmanager
def _progress(number: int, hidden: bool) -> Iterator[Callable[[int], object] | None]:
    """Show a bar on stderr; where that is no terminal, a line every half minute."""
    if hidden:
        yield None
        return
    if not sys.stderr.isatty():
        yield _Lines(number).update
        return
    with click.progressbar(length=number, file=sys.stderr, update_min_steps=max(1, number // 200)) as bar:
        yield bar.update


class _Lines:
    """Tells a log how many muons there are, every half minute."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._done = 0
        self._told = time.monotonic()

    def update(self, muons: int) -> None:
        """Count so many muons more."""
        self._done += muons
        if time.monotonic() - self._told >= BETWEEN_LINES:
            self._told += BETWEEN_LINES
            click.echo(f"{NAME}: {self._done:,} of {self._number:,} muons", err=True)


def _exposure(count: int, rate: Rate | None, target: Target | None, live_time: float | None, area: float | None) -> str:
    """Return how long the muons take to come: what was asked for, or what their number stands for."""
    if rate is None:
        return "rate unknown"
    place, hz = (f"the {target.name}", rate.hz) if target is not None else (f"{area or 1:g} m2", rate.hz * (area or 1))
    if live_time is not None:
        return f"live time {live_time:,g} s on {place} at {hz:,.5g} a second"
    return f"equivalent live time {count / hz:,.1f} s for {place} at {hz:,.5g} a second"


if __name__ == "__main__":
    main()
