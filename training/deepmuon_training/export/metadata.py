"""What an ONNX file says of its generator, by the contract."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from importlib.metadata import version

from deepmuon_runtime.model.family import depth_text
from deepmuon_runtime.model.metadata import CONTRACT_VERSION
from deepmuon_training.energy_transform import LAMBDA
from deepmuon_training.export.exportable import Exportable, Family
from deepmuon_training.medium import model_medium
from deepmuon_training.sample import Sample

__all__ = ["LICENCE", "Training", "family_metadata", "metadata"]

LICENCE = "BSD-3-Clause"


@dataclass(frozen=True)
class Training:
    """What a model was trained on.

    Parameters
    ----------
    depth_m, medium, source, provenance, rate, rate_uncertainty, smoothed, flux
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
    flux: str | None = None

    @classmethod
    def of(cls, sample: Sample, seed: int, *, zenith_max: float = 90.0, charge: int | None = None) -> Training:
        """Note what a sample is, without its muons."""
        alike = {f.name: getattr(sample, f.name) for f in fields(cls) if hasattr(sample, f.name) and f.name != "muons"}
        limit = zenith_max if zenith_max < 90 else None
        return cls(**alike, muons=len(sample), seed=seed, zenith_max_deg=limit, charge=charge)


def metadata(generator: Exportable, training: Training) -> dict[str, str]:
    """Return the model's metadata; what is unknown is left out."""
    place = {"depth_m": f"{training.depth_m:g}"}
    numbers = {
        "rate_hz_per_m2": None if training.rate is None else f"{training.rate:.6g}",
        "rate_uncertainty_hz_per_m2": None if training.rate_uncertainty is None else f"{training.rate_uncertainty:.3g}",
        "rate_relative_uncertainty": _relative(training.rate, training.rate_uncertainty),
        "boxcox_lambda": LAMBDA,
        "energy_mean": f"{generator.energy_mean:.9g}",
    }
    return _texts(generator, place, training, numbers)


def family_metadata(
    family: Family, knots: Sequence[Training], rate_relative_uncertainty: float | None
) -> dict[str, str]:
    """Return the same of a family; training is that of all knots, in order.

    What only some of them say, or say otherwise, is left out.
    """
    place = {
        "depth_m": depth_text(family.depths[0]),
        "depth_min_m": depth_text(family.depths[0]),
        "depth_max_m": depth_text(family.depths[-1]),
        "knots_m": " ".join(map(depth_text, family.depths)),
    }
    known = {"rate_relative_uncertainty": _short(rate_relative_uncertainty)}
    limits = [knot.zenith_max_deg for knot in knots if knot.zenith_max_deg is not None]
    together: dict[str, str | None] = {
        "medium": model_medium(knots[-1].medium),  # at sea level there is none, whatever its name
        "training_source": "; ".join(dict.fromkeys(knot.source for knot in knots)),
        "training_muons": str(sum(knot.muons for knot in knots)),
        "zenith_max_deg": f"{max(limits):.6g}" if len(limits) == len(knots) else None,
    }
    each = [{**_texts(family, place, knot, known), **together} for knot in knots]
    texts = {key: {one.get(key) for one in each} for key in each[-1]}
    return {key: text for key, found in texts.items() if len(found) == 1 and (text := found.pop()) is not None}


def _texts(
    generator: Exportable | Family, place: Mapping[str, str], training: Training, numbers: Mapping[str, object]
) -> dict[str, str]:
    known = {
        "contract_version": CONTRACT_VERSION,
        "architecture": generator.architecture,
        "flux": training.flux,
        **place,
        "medium": model_medium(training.medium),
        "surface": 0,  # a horizontal plane
        "muons_per_draw": generator.muons_per_draw,
        "latent_size": generator.latent_size,
        "energy_latents": None if generator.energy_latents is None else "{} {}".format(*generator.energy_latents),
        "energy_min_gev": generator.energy_range[0],  # all digits: a muon that the graph clips is within
        "energy_max_gev": generator.energy_range[1],
        "zenith_max_deg": None if training.zenith_max_deg is None else f"{training.zenith_max_deg:.6g}",
        "only_charge": None if training.charge is None else f"{training.charge:+d}",
        "created_by": f"deepmuon-training {version('deepmuon-training')}",
        "licence": LICENCE,
        **numbers,
        "training_source": training.source,
        "training_smoothed": None if training.smoothed is None else str(training.smoothed).lower(),
        "training_muons": training.muons,
        "training_seed": training.seed,
    }
    return {key: str(value) for key, value in known.items() if value is not None}


def _relative(rate: float | None, uncertainty: float | None) -> str | None:
    return None if rate is None or uncertainty is None else _short(uncertainty / rate)


def _short(number: float | None) -> str | None:
    return None if number is None else f"{number:.3g}"
