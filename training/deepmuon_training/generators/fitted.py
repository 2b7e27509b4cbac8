"""A trained generator, before it is an ONNX file: its networks, and what they were trained on."""

from __future__ import annotations

import io
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.files.whole import write_whole
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.export.onnx_export import Exportable, Mismatch, Training, export
from deepmuon_training.generators.quantile.azimuth_fit import AzimuthDensity
from deepmuon_training.generators.quantile.maps import QuantileGenerator
from deepmuon_training.generators.quantile.tables import table_error, tabulate
from deepmuon_training.generators.transformer.model import ChargeTable, TransformerModel
from deepmuon_training.generators.transformer.network import Transformer
from deepmuon_training.learning.charge import ChargeProbability
from deepmuon_training.learning.condition import EnergyCondition
from deepmuon_training.learning.power_law import PowerLawTails
from deepmuon_training.records import from_json, to_json

__all__ = ["Exported", "FittedGenerator", "export_fitted"]

_FORMAT, _FORMAT_VERSION = "deepmuon-generator", 1

Networks = QuantileGenerator | TransformerModel


@dataclass(frozen=True)
class FittedGenerator:
    """Networks with their preprocessing, and what training was.

    Parameters
    ----------
    networks : QuantileGenerator or TransformerModel
        By architecture.
    training : Training
        The sample and the seed.
    settings : dict
        Of the fit: the fields of `QuantileSchedules` or `TransformerSettings`.
    notes : tuple of str
        What its users should know.
    unphysical_before_mapping : float or None
        Fraction of the networks' muons that the graph has to mend; None where there can be none.
    """

    networks: Networks
    training: Training
    settings: dict[str, Any]
    notes: tuple[str, ...]
    unphysical_before_mapping: float | None

    @property
    def architecture(self) -> str:
        """Name of the architecture."""
        return self.networks.architecture

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write everything to one file.

        Raises
        ------
        RefusedError, FailedError
            As `deepmuon_runtime.files.whole.write_whole`.
        """
        contents = io.BytesIO()
        parts = {
            "format": _FORMAT,
            "format_version": _FORMAT_VERSION,
            "architecture": self.architecture,
            "networks": _PACK[self.architecture](self.networks),
            "training": to_json(self.training),
            "settings": self.settings,
            "notes": self.notes,
            "unphysical_before_mapping": self.unphysical_before_mapping,
        }
        torch.save(parts, contents)
        write_whole(path, contents.getvalue(), overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path) -> FittedGenerator:
        """Read what `save` wrote; nothing in the file is executed.

        Raises
        ------
        RefusedError
            If the file can't be read, or is none of this version.
        """
        try:
            parts = torch.load(path, weights_only=True)
            if parts["format"] != _FORMAT:
                raise KeyError(_FORMAT)
            version = parts["format_version"]
        except (OSError, RuntimeError, pickle.UnpicklingError, EOFError, LookupError, TypeError, ValueError) as error:
            why = f": {reason(error)}" if isinstance(error, OSError) else ""
            raise RefusedError(f"{path} is no generator that deepmuon-train fit wrote{why}") from error
        if version != _FORMAT_VERSION:
            raise RefusedError(f"{path} has format version {version}, and this release reads version {_FORMAT_VERSION}")
        return cls(
            networks=_UNPACK[parts["architecture"]](parts["networks"]),
            training=from_json(Training, parts["training"]),
            settings=parts["settings"],
            notes=parts["notes"],
            unphysical_before_mapping=parts["unphysical_before_mapping"],
        )


@dataclass(frozen=True)
class Exported:
    """What is known of an exported generator.

    Parameters
    ----------
    mismatch : Mismatch
        Between ONNX Runtime and PyTorch.
    notes : tuple of str
        What its card says.
    unphysical_before_mapping : float or None
        As in `FittedGenerator`.
    """

    mismatch: Mismatch
    notes: tuple[str, ...]
    unphysical_before_mapping: float | None


def export_fitted(generator: FittedGenerator, path: Path, *, overwrite: bool = False) -> Exported:
    """Write a generator as an ONNX file that keeps the contract.

    Raises
    ------
    RefusedError, FailedError
        As `deepmuon_training.export.onnx_export.export`; `FailedError` also if a map is not monotone.
    """
    exportable, notes = _exportable(generator)
    mismatch = export(exportable, generator.training, path, overwrite=overwrite)
    rounding = (
        f"ONNX Runtime differs from PyTorch in double precision by at most {mismatch.energy:.1e} of the energy and "
        f"{mismatch.direction:.1e} of a direction, on 100,000 muons."
    )
    return Exported(mismatch, (*generator.notes, *notes, rounding), generator.unphysical_before_mapping)


def _exportable(generator: FittedGenerator) -> tuple[Exportable, list[str]]:
    """Return what the file stores, and notes on it."""
    if isinstance(generator.networks, TransformerModel):
        return generator.networks, []
    tables = tabulate(generator.networks)
    return tables, [str(table_error(generator.networks, tables, seed=generator.training.seed))]


def _pack_quantile(networks: QuantileGenerator) -> dict[str, Any]:
    return {
        "mean": networks.transform.mean,
        "tails": to_json(networks.tails),
        "condition": to_json(networks.condition),
        "learned_azimuth": networks.azimuth is not None,
        "weights": networks.state_dict(),
    }


def _unpack_quantile(parts: dict[str, Any]) -> QuantileGenerator:
    condition, tails = from_json(EnergyCondition, parts["condition"]), from_json(PowerLawTails, parts["tails"])
    azimuth = AzimuthDensity(condition) if parts["learned_azimuth"] else None
    networks = QuantileGenerator(EnergyTransform(parts["mean"]), tails, ChargeProbability(condition), azimuth)
    networks.load_state_dict(parts["weights"])
    return networks


def _pack_transformer(model: TransformerModel) -> dict[str, Any]:
    return {
        "d": model.network.d,
        "weights": model.network.state_dict(),
        "mean": model.transform.mean,
        "angle": torch.from_numpy(model.angle),
        "charge": torch.from_numpy(model.charge.values),
        "charge_range": model.charge.x_range,
        "energy_range": model.energy_range,
    }


def _unpack_transformer(parts: dict[str, Any]) -> TransformerModel:
    network = Transformer(parts["d"])
    network.load_state_dict(parts["weights"])
    return TransformerModel(
        network,
        transform=EnergyTransform(parts["mean"]),
        angle=parts["angle"].numpy(),
        charge=ChargeTable(parts["charge"].numpy(), parts["charge_range"]),
        energy_range=parts["energy_range"],
    )


_PACK: dict[str, Any] = {"quantile": _pack_quantile, "transformer": _pack_transformer}
_UNPACK: dict[str, Any] = {"quantile": _unpack_quantile, "transformer": _unpack_transformer}
