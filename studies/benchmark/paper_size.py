"""Writes the transformer of the paper's size, d = 1024, with random weights.

``python -m studies.benchmark.paper_size OUT`` is what the benchmark runs.
Its muons are no physics, but it takes as long as a trained one. Needs deepmuon-training.
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch

from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import export
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.generators.transformer.model import ChargeTable, TransformerModel, radius_table
from deepmuon_training.generators.transformer.network import Transformer
from deepmuon_training.learning.charge import ChargeProbability
from deepmuon_training.learning.condition import EnergyCondition
from deepmuon_training.sample import Sample

__all__ = ["write_paper_size"]

WIDTH = 1024
SEED = 1


def write_paper_size(path: Path) -> None:
    """Write the model."""
    torch.manual_seed(SEED)
    sample = Sample(sea_level_muons(100_000, seed=SEED), depth_m=0.0, source="random weights")
    transform = EnergyTransform.fit(sample.muons.kinetic_energy)
    charge = ChargeProbability(EnergyCondition.fit(transform.pre_tanh(sample.muons.kinetic_energy)))
    network = Transformer(WIDTH).eval()
    for parameter in network.parameters():  # PyTorch begins all layers alike, and the export would store one
        if parameter.dim() > 1:
            torch.nn.init.xavier_uniform_(parameter)
    model = TransformerModel.stored(
        network,
        transform=transform,
        angle=radius_table(Transformer(8), sample.muons, seed=SEED, generated=1),  # of any network: it takes as long
        charge=ChargeTable.of(charge, transform),
        energy_range=(1e-3, 1e5),
    )
    export(model, Training.of(sample, SEED), path)


if __name__ == "__main__":
    write_paper_size(Path(sys.argv[1]))
