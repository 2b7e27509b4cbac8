"""What an ONNX file says of its generator, by the contract."""

from __future__ import annotations

from dataclasses import dataclass, fields
from importlib.metadata import version

from deepmuon_runtime.model.metadata import CONTRACT_VERSION
from deepmuon_training.energy_transform import LAMBDA
from deepmuon_training.export.exportable import Exportable
from deepmuon_training.sample import Sample

__all__ = ["LICENCE", "Training", "metadata"]

LICENCE = "BSD-3-Clause"


@dataclass(frozen=True)
class Training:
    """What a model was trained on.

    Parameters
    ----------
    depth_m, medium, source, provenance, rate, rate_uncertainty, smoothed
        Of the sample, see `deepmuon_training.sample.Sample`.
    muons
        How many.
    seed
        Of weights and batches.
    zenith_max_deg
        Largest zenith angle of its muons; None where that is the horizon.
    charge
        The one that all have; None where both are.
    """

    depth_m: float
    medium: str
    source: str
    provenance: tuple[str, ...]
    rate: float | None
    rate_uncertainty: float | None
    smoothed: bool | None
    muons: int
    seed: int
    zenith_max_deg: float | None = None
    charge: int | None = None

    @classmethod
    def of(cls, sample: Sample, seed: int, *, zenith_max: float = 90.0, charge: int | None = None) -> Training:
        """Note what a sample is, without its muons."""
        alike = {f.name: getattr(sample, f.name) for f in fields(cls) if hasattr(sample, f.name) and f.name != "muons"}
        limit = zenith_max if zenith_max < 90 else None
        return cls(**alike, muons=len(sample), seed=seed, zenith_max_deg=limit, charge=charge)


def metadata(generator: Exportable, training: Training) -> dict[str, str]:
    """Return the model's metadata; what is unknown is left out."""
    known = {
        "contract_version": CONTRACT_VERSION,
        "architecture": generator.architecture,
        "depth_m": f"{training.depth_m:g}",
        "medium": training.medium,
        "muons_per_draw": generator.muons_per_draw,
        "latent_size": generator.latent_size,
        "energy_min_gev": generator.energy_range[0],  # all digits: a muon that the graph clips is within
        "energy_max_gev": generator.energy_range[1],
        "zenith_max_deg": None if training.zenith_max_deg is None else f"{training.zenith_max_deg:.6g}",
        "only_charge": None if training.charge is None else f"{training.charge:+d}",
        "created_by": f"deepmuon-training {version('deepmuon-training')}",
        "licence": LICENCE,
        "rate_hz_per_m2": None if training.rate is None else f"{training.rate:.6g}",
        "rate_uncertainty_hz_per_m2": None if training.rate_uncertainty is None else f"{training.rate_uncertainty:.3g}",
        "boxcox_lambda": LAMBDA,
        "energy_mean": f"{generator.energy_mean:.9g}",
        "training_source": training.source,
        "training_smoothed": None if training.smoothed is None else str(training.smoothed).lower(),
        "training_muons": training.muons,
        "training_seed": training.seed,
    }
    return {key: str(value) for key, value in known.items() if value is not None}
