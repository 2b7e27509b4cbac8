"""A trained generator, before it is an ONNX file: what was learned, and of which muons."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.files.whole import write_whole
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import Mismatch, export
from deepmuon_training.generators.registry import architecture
from deepmuon_training.learning.threads import one_thread
from deepmuon_training.records import from_json, to_json
from deepmuon_training.sealed import read_sealed, seal

__all__ = ["Exported", "FittedGenerator", "export_fitted"]

_FORMAT, _FORMAT_VERSION = "deepmuon-generator", 3


@dataclass(frozen=True)
class FittedGenerator:
    """What was learned, with its preprocessing, and what training was.

    Parameters
    ----------
    architecture : str
        Its name.
    networks
        As that architecture has them.
    training : Training
        The sample and the seed.
    settings : dict
        Of the fit, by the names of the fields of the architecture's `settings`.
    notes : tuple of str
        What its users should know.
    unphysical_before_mapping : float or None
        Fraction of the networks' muons that the graph has to mend; None where there can be none.
    """

    architecture: str
    networks: Any
    training: Training
    settings: dict[str, Any]
    notes: tuple[str, ...]
    unphysical_before_mapping: float | None

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write everything to one file.

        Raises
        ------
        RefusedError, FailedError
            As `deepmuon_runtime.files.whole.write_whole`.
        """
        parts = {
            "format": _FORMAT,
            "format_version": _FORMAT_VERSION,
            "architecture": self.architecture,
            "networks": architecture(self.architecture).pack(self.networks),
            "training": to_json(self.training),
            "settings": self.settings,
            "notes": self.notes,
            "unphysical_before_mapping": self.unphysical_before_mapping,
        }
        write_whole(path, seal(parts), overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path) -> FittedGenerator:
        """Read what `save` wrote; nothing in the file is executed.

        Raises
        ------
        RefusedError
            If the file can't be read, is damaged, or none of this version.
        """
        what, instead = "generator that deepmuon-train fit wrote", "fit it again"
        parts = read_sealed(Path(path), what, instead)
        if parts.get("format") != _FORMAT:
            raise RefusedError(f"{path} is no {what}: {instead}")
        version = parts.get("format_version")
        if version != _FORMAT_VERSION:
            raise RefusedError(f"{path} has format version {version}, and this release reads version {_FORMAT_VERSION}")
        return cls(
            architecture=parts["architecture"],
            networks=architecture(parts["architecture"]).unpack(parts["networks"]),
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


@one_thread()
def export_fitted(generator: FittedGenerator, path: Path, *, overwrite: bool = False) -> Exported:
    """Write a generator as an ONNX file that keeps the contract.

    Raises
    ------
    RefusedError, FailedError
        As `deepmuon_training.export.onnx_export.export`; `FailedError` also if a map is not monotone.
    """
    exportable, notes = architecture(generator.architecture).exportable(generator.networks, generator.training.seed)
    mismatch = export(exportable, generator.training, path, overwrite=overwrite)
    return Exported(mismatch, (*generator.notes, *notes, mismatch.note), generator.unphysical_before_mapping)
