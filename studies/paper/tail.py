"""The high-energy tail of a billion muons against the power law on the model's card.

python -m studies.paper.tail

The muons are streamed: only those above the energy where the power law begins are kept.
"""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import kstest, poisson

from deepmuon_runtime import Generator, Model, Muons
from deepmuon_training.reports.pictures import STYLE
from studies.shared.report import COLOURS, write

SEED = 1
LEVEL = 1e-6
"""Probability of a muon beyond which the card tells of a power law."""

PROBABILITIES = (1e-6, 1e-7, 1e-8, 1e-9)
LIMIT = re.compile(
    r"Above ([\d.e+]+) GeV, which one muon in a million has, .* goes as E\^-([\d.]+), up to ([\d.e+]+) GeV"
)

Float = NDArray[np.float64]


class PowerLaw(NamedTuple):
    """The survival function on a card: proportional to E^-exponent - highest^-exponent above `lowest` [GeV]."""

    level: float
    """Its value at `lowest`."""
    lowest: float
    exponent: float
    highest: float

    def survival(self, energy: Float) -> Float:
        """Probability of a muon above an energy [GeV]."""
        power, end = np.power(energy, -self.exponent), self.highest**-self.exponent
        result: Float = self.level * (power - end) / (self.lowest**-self.exponent - end)
        return result

    def quantile(self, probability: float) -> float:
        """Energy [GeV] above which a muon is with this probability."""
        end = self.highest**-self.exponent
        return float((end + probability / self.level * (self.lowest**-self.exponent - end)) ** (-1 / self.exponent))


@click.command(help=__doc__)
@click.option("--depth", default=0.0, show_default=True, help="Of the released model, in metres.")
@click.option("-n", "--number", default=10**9, show_default=True, help="How many muons.")
def main(depth: float, number: int) -> None:
    """Sample, compare, write."""
    generator = Generator.open(depth)
    law = power_law(generator.model)
    muons = tail(generator, number, law.lowest)
    scores = [score(law, muons, number, probability) for probability in PROBABILITIES]
    far = muons[muons.kinetic_energy > law.quantile(1e-7)]
    numbers = {
        "model": generator.model.name,
        "muons": number,
        "seed": SEED,
        "power_law": law._asdict(),
        "kept": len(muons),
        "expected_kept": number * law.level,
        "repeated_among_kept": repeated(muons),
        "above_the_1e-7_quantile": len(far),
        "repeated_energies_above_it": len(far) - len(np.unique(far.kinetic_energy)),
        "highest_gev": float(muons.kinetic_energy.max()),
        "ks_p_value": float(kstest(muons.kinetic_energy, lambda x: 1 - law.survival(x) / law.level).pvalue),
        "tail": [line._asdict() for line in scores],
    }
    write(Path(__file__), numbers, figure=draw(muons, law, number))
    Path(__file__).with_suffix(".md").write_text(page(numbers), encoding="utf-8")


def power_law(model: Model) -> PowerLaw:
    """Read the power law from a released model's card."""
    card = files("deepmuon_models").joinpath(model.name).with_suffix(".md").read_text(encoding="utf-8")
    found = LIMIT.search(card)
    if found is None:
        raise click.ClickException(f"the card of {model.name} tells of no power law")
    lowest, exponent, highest = map(float, found.groups())
    return PowerLaw(LEVEL, lowest, exponent, highest)


def tail(generator: Generator, number: int, lowest: float) -> Muons:
    """Return the muons above an energy [GeV], of a stream of many."""
    parts = generator.chunks(number, SEED)
    return Muons.concatenate([part[part.kinetic_energy > lowest] for part in parts])


class Score(NamedTuple):
    """Muons above the energy that the power law gives for a probability."""

    probability: float
    energy_gev: float
    expected: float
    found: int
    chance: float
    """Of a Poisson number at least as far from the expected one."""


def score(law: PowerLaw, muons: Muons, number: int, probability: float) -> Score:
    """Count them."""
    energy, expected = law.quantile(probability), number * probability
    found = int((muons.kinetic_energy > energy).sum())
    return Score(probability, energy, expected, found, two_sided(found, expected))


def page(numbers: dict[str, Any]) -> str:
    """Return the numbers as Markdown, with the picture."""
    rows = [
        f"| {line['probability']:.0e} | {line['energy_gev']:,.0f} | {line['expected']:,.4g} | {line['found']:,} "
        f"| {line['chance']:.2f} |"
        for line in numbers["tail"]
    ]
    return "\n".join(
        [
            f"# {numbers['muons']:,} muons of {numbers['model']}",
            "",
            "| probability | E / GeV | expected above E | found | chance of one so far off |",
            "|--:|--:|--:|--:|--:|",
            *rows,
            "",
            f"{numbers['kept']:,} muons lie where the power law holds, {numbers['expected_kept']:,.0f} were expected; "
            f"the Kolmogorov-Smirnov test of their energies against it gives p = {numbers['ks_p_value']:.2g}.",
            f"{numbers['repeated_among_kept']} of them are there twice. Of the {numbers['above_the_1e-7_quantile']} "
            f"above the 1e-7 quantile {numbers['repeated_energies_above_it']} have the energy of another.",
            f"The highest has {numbers['highest_gev']:,.0f} GeV.",
            "",
            "![Muons above an energy](tail.png)",
            "",
        ]
    )


def repeated(muons: Muons) -> int:
    """Count muons that are there already, with all their digits."""
    columns = np.stack([muons.kinetic_energy, muons.u, muons.v, muons.w], axis=1)
    return len(columns) - len(np.unique(columns, axis=0))


def two_sided(found: int, expected: float) -> float:
    """Chance of a Poisson number at least as far from its mean."""
    return float(min(1.0, 2 * min(poisson.cdf(found, expected), poisson.sf(found - 1, expected))))


def draw(muons: Muons, law: PowerLaw, number: int) -> Figure:
    """Draw how many muons lie above an energy, and their ratio to the power law."""
    energy = np.sort(muons.kinetic_energy)[::-1].astype(float)
    rank = np.arange(1, len(energy) + 1)
    expected = number * law.survival(energy)
    with rc_context(STYLE):
        figure = Figure(figsize=(7, 5.5), layout="constrained")
        spectrum, ratio = figure.subplots(2, sharex=True, height_ratios=(3, 1))
        spectrum.loglog(energy, rank, drawstyle="steps-post", color=COLOURS[0], label=f"{number:.0e} muons")
        spectrum.loglog(energy, expected, "--", color=COLOURS[1], label="power law of the card")
        spectrum.axvline(law.quantile(1e-7), color=COLOURS[5], linewidth=0.8, linestyle=":")
        spectrum.text(law.quantile(1e-7) * 1.05, rank[-1] / 3, "one muon in ten million", fontsize=9)
        spectrum.set(ylabel="muons above E")
        spectrum.legend(loc="lower left")
        noise = 1 / np.sqrt(expected)
        ratio.fill_between(energy, 1 - noise, 1 + noise, color=COLOURS[1], alpha=0.2, linewidth=0)
        ratio.plot(energy, rank / expected, drawstyle="steps-post", color=COLOURS[0])
        ratio.set(xscale="log", ylim=(0.5, 1.5), xlabel="E / GeV", ylabel="to power law")
    return figure


if __name__ == "__main__":
    main()
