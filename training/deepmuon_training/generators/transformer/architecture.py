"""The `transformer` architecture, in one object."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.energy_transform import EnergyTransform, box_cox
from deepmuon_training.export.stored import StoredGenerator
from deepmuon_training.generators.architecture import Architecture, Azimuth, Fit
from deepmuon_training.generators.transformer.fit import TransformerSettings, fit_transformer
from deepmuon_training.generators.transformer.model import ChargeTable, TransformerModel, radius_table, raw_muons
from deepmuon_training.generators.transformer.network import Transformer
from deepmuon_training.learning.charge import fit_charge
from deepmuon_training.learning.support import Support
from deepmuon_training.sample import Sample

__all__ = ["ARCHITECTURE"]


class _Transformer(Architecture[TransformerSettings, TransformerModel]):
    """The paper's network, and what it lacks: true zenith angles and charges. d muons a draw."""

    name = "transformer"
    settings = TransformerSettings
    checkpoints = ("transformer.pt", "charge.pt")

    def check_azimuth(self, azimuth: Azimuth) -> None:
        if azimuth == "learned":
            raise RefusedError(
                'azimuth = "learned" is a choice of quantile: a transformer always learns it, leave it out'
            )

    def fit(
        self,
        sample: Sample,
        settings: TransformerSettings,
        *,
        seed: int,
        azimuth: Azimuth,
        support: Support,
        checkpoint_folder: Path | None,
        progress: bool,
    ) -> Fit[TransformerModel]:
        muons = sample.muons
        checkpoint, charge_checkpoint = (checkpoint_folder and checkpoint_folder / name for name in self.checkpoints)
        network, transform = fit_transformer(
            muons, seed=seed, settings=settings, checkpoint=checkpoint, progress=progress
        )
        charge = fit_charge(
            muons, transform, seed=seed, schedule=settings.charge, checkpoint=charge_checkpoint, progress=progress
        )
        energy_range = support.energy_min, float(muons.kinetic_energy.max())
        model = TransformerModel.stored(
            network,
            transform=transform,
            angle=radius_table(
                network, muons, seed=seed, generated=settings.calibration, cos_zenith_min=support.cos_zenith_min
            ),
            charge=ChargeTable.of(charge, transform),
            energy_range=energy_range,
        )
        raw = raw_muons(model.network, settings.calibration // 2, seed=(seed + 1) % 2**64)
        energy, radius = box_cox(raw[:, 0] + transform.mean).numpy(), raw[:, 1:].norm(dim=1).numpy()
        outside = (energy < energy_range[0]) | (energy > energy_range[1])
        grazing = np.mean((radius < 1) & (radius > np.sqrt(1 - 0.2**2)))
        truth = np.mean(muons.cos_zenith < 0.2)
        notes = (
            f"The {model.muons_per_draw} muons of a draw are a stratified, correlated set.",
            f"Of the bare network's muons {np.mean(radius >= 1):.2%} have cos2 x + cos2 y > 1, and {grazing:.3%} have "
            f"cos zenith < 0.2, where the training sample has {truth:.3%}: the graph's table of zenith angles mends "
            f"both. {np.mean(outside):.4%} have an energy outside of {energy_range[0]:g} to {energy_range[1]:.0f} GeV, "
            "to which it is clipped.",
        )
        unphysical = float(np.mean((radius >= 1) | outside))
        return Fit(model, notes, unphysical)

    def pack(self, networks: TransformerModel) -> dict[str, Any]:
        return {
            "d": networks.network.d,
            "weights": networks.network.state_dict(),
            "mean": networks.transform.mean,
            "angle": torch.from_numpy(networks.angle),
            "charge": torch.from_numpy(networks.charge.values),
            "charge_range": networks.charge.x_range,
            "energy_range": networks.energy_range,
        }

    def unpack(self, parts: dict[str, Any]) -> TransformerModel:
        network = Transformer(parts["d"])
        network.load_state_dict(parts["weights"])
        return TransformerModel(
            network,
            transform=EnergyTransform(parts["mean"]),
            angle=parts["angle"].numpy(),
            charge=ChargeTable(parts["charge"].numpy(), parts["charge_range"]),
            energy_range=parts["energy_range"],
        )

    def exportable(self, networks: TransformerModel, seed: int) -> tuple[TransformerModel, tuple[str, ...]]:
        return networks, ()

    def read_back(self, stored: StoredGenerator) -> TransformerModel:
        network = Transformer(int(stored.metadata["muons_per_draw"]))
        with torch.no_grad():
            for parameter, weight in zip(_in_graphs_order(network), stored.weights(), strict=True):
                parameter.copy_(weight.T if weight.ndim == 2 else weight)
        angle, charge = stored.tables()
        return TransformerModel(
            network,
            transform=EnergyTransform(stored.energy_mean),
            angle=angle.ravel(),
            charge=ChargeTable(charge, _charge_range(stored, len(charge))),
            energy_range=stored.energy_range,
        )


def _in_graphs_order(network: Transformer) -> Iterator[nn.Parameter]:
    yield from network.embedding.parameters()
    yield from network.norm.parameters()
    for layer in network.encoder.layers:
        for part in (layer.self_attn, layer.norm1, layer.linear1, layer.linear2, layer.norm2):
            yield from part.parameters()
    yield from network.decoder.parameters()


def _charge_range(stored: StoredGenerator, rows: int) -> tuple[float, float]:
    """Return x of the charge table's first and last row, of row = (x - low) scale: the first constant subtracted."""
    nodes = zip(stored.graph.node, stored.graph.node[1:], strict=False)
    pairs = ((node, after) for node, after in nodes if node.op_type == "Sub" and node.input[1] in stored.constants)
    low, scale = (float(stored.constants[node.input[1]]) for node in next(pairs))
    return low, low + (rows - 1) / scale


ARCHITECTURE = _Transformer()
