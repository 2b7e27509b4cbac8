"""What an evaluation found: all scores of one generated set against one held-out set, and the counts behind them."""

from __future__ import annotations

from dataclasses import dataclass

from deepmuon_training.records import from_json, to_json
from deepmuon_training.scores.azimuth import AzimuthScore
from deepmuon_training.scores.chi_square import ChiSquare
from deepmuon_training.scores.classifier import ClassifierScore
from deepmuon_training.scores.histograms import Bin, CellScore, Counts, TailScore
from deepmuon_training.scores.independence import Independence
from deepmuon_training.scores.kolmogorov_smirnov import KolmogorovSmirnov
from deepmuon_training.scores.totals import ChargeRatio, RateScore, UnphysicalMuons

__all__ = ["Evaluation", "Spectra"]


@dataclass(frozen=True)
class Spectra:
    """Counts to draw, under- and overflow first and last where there are any.

    Parameters
    ----------
    plus_by_energy, minus_by_energy : tuple of int, [52]
        mu+ and mu- in the bins of `histogram_scores.ENERGY_EDGES`.
    by_cos_zenith : tuple of int, [20]
        Muons in bins of 0.05, from the horizon to the vertical.
    """

    plus_by_energy: tuple[int, ...]
    minus_by_energy: tuple[int, ...]
    by_cos_zenith: tuple[int, ...]

    @classmethod
    def of(cls, counts: Counts) -> Spectra:
        """Sum the table of `histogram_scores.count_muons`."""
        minus, plus = counts.sum(axis=2).tolist()
        return cls(tuple(plus), tuple(minus), tuple(counts.sum(axis=(0, 1)).tolist()))


@dataclass(frozen=True)
class Evaluation:
    """All scores of one generated set against one held-out set.

    Parameters
    ----------
    generated_muons, held_out_muons : int
        Physical muons that were compared.
    muons_per_draw, seed : int
        As given.
    ks : dict of KolmogorovSmirnov
        By column: "energy", "u", "v", "cos zenith".
    cells : CellScore
        On CRY's cells.
    cells_against_raw : CellScore or None
        The same against muons whose histogram steps were not taken out.
    energy_bins, zenith_bins, tails, charge, charge_ratio, azimuth, classifier, independence, unphysical, rate
        See their classes; rate is None where one is unknown.
    generated_spectra, held_out_spectra : Spectra
        What the pictures show.
    variance_factor : float
        How many times larger than of independent muons the variance of held-out counts was taken to be.
    surface : int
        What the generator's muons cross: 0 is a horizontal plane, 1 a sphere, of which those that cross a plane were
        compared, see `deepmuon_training.scores.model_evaluation`.
    """

    generated_muons: int
    held_out_muons: int
    muons_per_draw: int
    seed: int
    ks: dict[str, KolmogorovSmirnov]
    cells: CellScore
    cells_against_raw: CellScore | None
    energy_bins: tuple[Bin, ...]
    zenith_bins: tuple[Bin, ...]
    tails: tuple[TailScore, ...]
    charge: ChiSquare
    charge_ratio: ChargeRatio
    azimuth: AzimuthScore
    classifier: ClassifierScore
    independence: Independence
    unphysical: UnphysicalMuons
    rate: RateScore | None
    generated_spectra: Spectra
    held_out_spectra: Spectra
    variance_factor: float = 1.0
    surface: int = 0

    def to_json(self) -> str:
        """Write everything as JSON."""
        return to_json(self)

    @classmethod
    def from_json(cls, text: str) -> Evaluation:
        """Read what `to_json` wrote."""
        return from_json(cls, text)
