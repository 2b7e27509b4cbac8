"""Puts the models of release 0.1.0, whose networks are not kept, into this release's form.

    python models/first_models.py FOLDER

The folder holds the ONNX files of release 0.1.0. A `transformer` keeps all its numbers. Of a
`quantile` model the tables lay elsewhere, evenly in the logarithm of the tail probability, with a sign: the maps are
evaluated, by the interpolation that 0.1.0 used, at the knots of this release.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import METADATA_PREFIX
from deepmuon_training.energy_transform import box_cox
from deepmuon_training.export.exportable import Exportable
from deepmuon_training.export.graph_steps import bilinear, linear, locate
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import export
from deepmuon_training.generators.quantile.cells import COLUMN_REACH, column_logits, energy_logits, row_logits
from deepmuon_training.generators.quantile.tables import QuantileTables
from deepmuon_training.generators.read_back import read_numbers
from deepmuon_training.release.card import manifest_entry
from deepmuon_training.release.vectors import muon_vectors
from make import RELEASED, VECTORS, write_manifest

_ENERGY_SHAPE, _PLANE_SHAPE = (3841, 1), (81, 129)
_ENERGY_REACH, _ROW_REACH = 34.0, 10.0
_INSIDE = 1 - 1e-9


def from_first(contents: bytes) -> tuple[Exportable, Training]:
    """Return the generator in a file of release 0.1.0, and what its metadata says of its training.

    Raises
    ------
    RefusedError
        If it is none.
    """
    model = onnx.load_from_string(contents)
    known = {prop.key.removeprefix(METADATA_PREFIX): prop.value for prop in model.metadata_props}
    quantile = known.get("architecture") == "quantile"
    return _quantile(model, known) if quantile else read_numbers(contents), _training(known)


def _quantile(model: onnx.ModelProto, known: dict[str, str]) -> QuantileTables:
    stored = [numpy_helper.to_array(tensor) for tensor in model.graph.initializer if len(tensor.dims) == 2]
    if [array.shape for array in stored] != [_ENERGY_SHAPE, _PLANE_SHAPE, _PLANE_SHAPE]:
        raise RefusedError("no quantile model of release 0.1.0")
    energy, zenith, charge = (torch.from_numpy(array.astype(np.float64)) for array in stored)
    cell, inside = locate(_signed_log_tail(energy_logits()) * _INSIDE, _ENERGY_SHAPE[0] // 2 / _ENERGY_REACH)
    x = linear(energy[:, 0], cell + _ENERGY_SHAPE[0] // 2, inside)
    rows, columns = (size // 2 for size in _PLANE_SHAPE)
    limit = _ROW_REACH * (1 - 1e-4)
    i, a = locate(_signed_log_tail(row_logits()).clamp(-limit, limit)[:, None], rows / _ROW_REACH)
    j, b = locate(column_logits()[None, :] * _INSIDE, columns / COLUMN_REACH)
    zenith, charge = (bilinear(table, i + rows, a, j + columns, b) for table in (zenith, charge))
    return QuantileTables(
        energy=torch.log(box_cox(x)).float().numpy(),
        zenith=zenith.float().numpy(),
        charge=charge.float().numpy(),
        energy_range=(float(known["energy_min_gev"]), float(known["energy_max_gev"])),
        energy_mean=float(known["energy_mean"]),
    )


def _signed_log_tail(t: torch.Tensor) -> torch.Tensor:
    """Return -sign(t) log p, where p / 2 is the tail probability on the side of the logit t."""
    tail: torch.Tensor = torch.sign(t) * (torch.nn.functional.softplus(t.abs()) - np.log(2))
    return tail


def _training(known: dict[str, str]) -> Training:
    number = {key: float(known[key]) if key in known else None for key in ("rate_hz_per_m2", _UNCERTAINTY)}
    return Training(
        depth_m=float(known["depth_m"]),
        medium=known["medium"],
        source=known["training_source"],
        provenance=(),
        rate=number["rate_hz_per_m2"],
        rate_uncertainty=number[_UNCERTAINTY],
        smoothed={"true": True, "false": False}.get(known.get("training_smoothed", "")),
        muons=int(known["training_muons"]),
        seed=int(known["training_seed"]),
        flux="cry",
    )


_UNCERTAINTY = "rate_uncertainty_hz_per_m2"


def release(old: Path) -> None:
    """Put a model of release 0.1.0 where it is released, in this release's form, with its test vectors and card."""
    generator, training = from_first(old.read_bytes())
    new = RELEASED / old.name
    mismatch = export(generator, training, new, overwrite=True)
    (VECTORS / f"{new.stem}.json").write_text(muon_vectors(new), encoding="utf-8")
    described = manifest_entry(new)
    card = new.with_suffix(".md").read_text()
    table = "".join(f"| {key} | {value} |\n" for key, value in described.items())
    card = re.sub(r"(?<=\|---\|---\|\n)(\| .* \|\n)+", table, card, count=1)
    card = re.sub(
        r"^- (The tables differ|ONNX Runtime differs|The numbers of release).*\n", "", card, flags=re.MULTILINE
    )
    note = (
        "- The numbers of release 0.1.0 in the form of this one (`python models/first_models.py`): the scores above "
        f"are those of the file of 0.1.0. ONNX Runtime differs from PyTorch in double precision by at most "
        f"{mismatch.energy:.1e} of the energy and {mismatch.direction:.1e} of a direction, on 100,000 muons.\n"
    )
    new.with_suffix(".md").write_text(card.replace("## Limits\n\n", f"## Limits\n\n{note}"))
    print(f"{new.name}: {described['size']} bytes, {mismatch}")


if __name__ == "__main__":
    for path in sorted(Path(sys.argv[1]).glob("*.onnx")):
        release(path)
    write_manifest()
