"""The `transformer` generator as stored numbers: its evaluation, in PyTorch and as an ONNX graph.

Three things are added to the paper's network, all in the graph:

- its cos x and cos y are free numbers, and about one muon in a hundred would have cos2 x + cos2 y > 1. A monotone
  table takes the radius sqrt(cos2 x + cos2 y) to the zenith angle of the same rank in the training sample;
- d latents decide the charges by P(mu+ | energy, zenith), a table;
- d latents are keys by which the muons of a draw are sorted, since its positions are not alike: so a draw that is cut
  short is not biased.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from onnx import TensorProto

from deepmuon_runtime.muons import Muons
from deepmuon_training.energy_transform import EnergyTransform, box_cox
from deepmuon_training.export.graph import Graph
from deepmuon_training.export.graph_steps import (
    LARGEST_LATENT,
    bilinear,
    bilinear_cells,
    charge_sign,
    interpolation_cells,
    kinetic_energy,
    linear,
    locate,
    look_up,
    matrix,
    on_plane,
    place,
)
from deepmuon_training.generators.transformer.fit import as_rows
from deepmuon_training.generators.transformer.network import HEADS, LATENTS, Transformer
from deepmuon_training.learning.charge import ChargeProbability

__all__ = ["ChargeTable", "TransformerModel", "radius_table", "raw_muons"]

_RADIUS_REACH = 1.4375  # above sqrt(2), the largest radius of two cosines
_RADIUS_KNOTS = 1472  # 1024 to a unit of radius
_ROUNDING = 2.0**-21  # relative, of cos zenith in the graph
_GRAZING = 1e-4  # rad under the horizon: no muon is generated nearer to it

_CHARGE_ROWS, _CHARGE_COLUMNS = 129, 17

Float32 = NDArray[np.float32]


def raw_muons(network: Transformer, count: int, *, seed: int) -> torch.Tensor:
    """Return what the bare network makes of random latents, [about count, 3]: x - mean of the energy, cos x, cos y."""
    random = torch.Generator().manual_seed(seed)
    parts = []
    with torch.no_grad():
        for _ in range(count // (1024 * network.d) + 1):
            rows = as_rows(network(2 * torch.rand(1024, LATENTS, generator=random) - 1))
            parts.append(torch.cat([rows[:, :1], torch.tanh(rows[:, 1:])], dim=1))
    return torch.cat(parts)


def radius_table(
    network: Transformer, muons: Muons, *, seed: int, generated: int = 4_000_000, cos_zenith_min: float = 0.0
) -> Float32:
    """Tabulate the zenith angle [rad] of the radius sqrt(cos2 x + cos2 y) of generated muons.

    The angle is the one of equal rank in the sample, so that generated muons have the sample's zenith
    distribution; beyond the largest generated radius it goes on evenly towards the horizon.

    Parameters
    ----------
    network
        The network.
    muons
        The sample.
    seed
        Of the latents.
    generated
        How many muons the network makes for it, about.
    cos_zenith_min
        No muon is flatter.

    Returns
    -------
    float32 [knots + 1]
        At radii 0 to 1.4375.
    """
    radii = np.sort(raw_muons(network, generated, seed=seed)[:, 1:].double().norm(dim=1).numpy())
    angles = np.sort(np.arctan2(np.hypot(muons.u, muons.v, dtype=np.float64), muons.cos_zenith.astype(np.float64)))
    knots = np.linspace(0, _RADIUS_REACH, _RADIUS_KNOTS + 1)
    rank = np.searchsorted(radii, knots) / len(radii)
    angle = np.interp(rank, (np.arange(len(angles)) + 0.5) / len(angles), angles)
    beyond = knots > radii[-1]
    flattest = min(np.arccos(min(cos_zenith_min * (1 + _ROUNDING), 1.0)), np.pi / 2 - _GRAZING)
    angle[beyond] = np.interp(knots[beyond], [radii[-1], _RADIUS_REACH], [angles[-1], flattest])
    angle[0] = 0.0
    table: Float32 = np.minimum(angle, flattest).astype(np.float32)
    return table


@dataclass(frozen=True)
class ChargeTable:
    """2 P(mu+) - 1 as a table, evenly over x = (9 E / MeV + 1)^(1/9) and cos zenith.

    Parameters
    ----------
    values : float32 [rows, columns]
        The table.
    x_range
        x of the first and last row; cos zenith goes from 0 to 1.
    """

    values: Float32
    x_range: tuple[float, float]

    @classmethod
    def of(cls, charge: ChargeProbability, transform: EnergyTransform) -> ChargeTable:
        """Evaluate the network where its condition varies."""
        low, high = charge.condition.low, charge.condition.high
        y, cos_zenith = torch.linspace(low, high, _CHARGE_ROWS), torch.linspace(0, 1, _CHARGE_COLUMNS)
        with torch.no_grad():
            logit = charge(*(grid.flatten() for grid in torch.meshgrid(y, cos_zenith, indexing="ij")))
        values = torch.tanh(logit / 2).reshape(_CHARGE_ROWS, _CHARGE_COLUMNS).numpy()
        return cls(values, (low + transform.mean, high + transform.mean))


@dataclass(frozen=True)
class TransformerModel:
    """The numbers of an exported `transformer` model.

    Parameters
    ----------
    network
        With weights that float16 holds.
    transform
        Between energy and the network's first column.
    angle : float32 [knots + 1]
        `radius_table`.
    charge
        Probabilities of mu+.
    energy_range
        Lowest and highest kinetic energy [GeV], of the training sample; the network's are clipped to it.
    """

    network: Transformer
    transform: EnergyTransform
    angle: Float32
    charge: ChargeTable
    energy_range: tuple[float, float]

    architecture = "transformer"
    energy_latents = None

    @classmethod
    def stored(cls, network: Transformer, **others: Any) -> TransformerModel:
        """Round the network's weights to float16, as the file stores them."""
        rounded = copy.deepcopy(network)
        with torch.no_grad():
            for parameter in rounded.parameters():
                parameter.copy_(parameter.half().float())
        return cls(rounded, **others)

    @property
    def latent_size(self) -> int:
        """100 numbers for the network, d for the charges, d for the order."""
        return LATENTS + 2 * self.network.d

    @property
    def muons_per_draw(self) -> int:
        """The network's d."""
        return self.network.d

    @property
    def energy_mean(self) -> float:
        """The transformation's mean."""
        return self.transform.mean

    def __call__(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Evaluate in PyTorch: energy [n] in GeV, direction [n, 3], charge [n] of latents [draws, 100 + 2 d]."""
        d = self.network.d
        latent = latent.clamp(-LARGEST_LATENT, LARGEST_LATENT)
        network = copy.deepcopy(self.network).to(latent.dtype)
        order = torch.sort(latent[:, LATENTS + d :], dim=1, descending=True, stable=True).indices
        values = network(latent[:, :LATENTS]).gather(2, order.unsqueeze(1).expand(-1, 3, -1))
        pre_tanh, x_atanh, y_atanh = values.transpose(0, 1).flatten(1)
        cos_x, cos_y = torch.tanh(x_atanh), torch.tanh(y_atanh)
        radius = torch.sqrt(cos_x**2 + cos_y**2)
        zenith = linear(torch.from_numpy(self.angle), *locate(radius, _RADIUS_KNOTS / _RADIUS_REACH))
        stretch = torch.sin(zenith) / radius.clamp(min=_SMALLEST_RADIUS)
        cos_zenith = torch.cos(zenith)
        direction = torch.stack([cos_x * stretch, cos_y * stretch, -cos_zenith], dim=1)
        x = pre_tanh + self.transform.mean
        charge = torch.where(latent[:, LATENTS : LATENTS + d].flatten() < self._threshold(x, cos_zenith), 1, -1)
        return box_cox(x).clamp(*self.energy_range), direction, charge.to(torch.int8)

    def _threshold(self, x: torch.Tensor, cos_zenith: torch.Tensor) -> torch.Tensor:
        table = torch.from_numpy(self.charge.values)
        rows, cols = table.shape
        row = ((x - self.charge.x_range[0]) * self._row_scale).clamp(0, rows - 1 - 1e-3)
        column = (cos_zenith * (cols - 1)).clamp(0, cols - 1 - 1e-3)
        return bilinear(table, *locate(row, 1.0), *locate(column, 1.0))

    @property
    def _row_scale(self) -> float:
        low, high = self.charge.x_range
        return (len(self.charge.values) - 1) / (high - low)

    def graph(self) -> tuple[Graph, str, str, str]:
        """Build the same in ONNX; returns the graph and the names of its energy, direction and charge."""
        g, d = Graph(), self.network.d
        flat = np.array([-1], dtype=np.int64)
        with g.scope("latent"):
            latent = g("Clip", "latent", -LARGEST_LATENT, LARGEST_LATENT)
            sizes = np.array([LATENTS, d, d], dtype=np.int64)
            noise, charge_latent, keys = g.several("Split", 3, latent, sizes, axis=1)
        with g.scope("order"):
            order = g.several("TopK", 2, keys, np.array([d], dtype=np.int64), axis=1)[1]
            order = g("Unsqueeze", order, np.array([2], dtype=np.int64))
        with g.scope("network"):
            tokens = self._network_graph(g, noise)
        with g.scope("order"):
            pre_tanh, x_atanh, y_atanh = (
                g("Reshape", g("GatherND", token, order, batch_dims=1), flat)
                for token in (g("Gather", tokens, np.array(k, dtype=np.int64), axis=1) for k in range(3))
            )
        with g.scope("direction"):
            direction, cos_zenith = self._direction_graph(g, g("Tanh", x_atanh), g("Tanh", y_atanh))
        with g.scope("charge"):
            x = g("Add", pre_tanh, self.transform.mean)
            threshold = self._threshold_graph(g, x, cos_zenith)
            charge = charge_sign(g, g("Reshape", charge_latent, flat), threshold)
        with g.scope("energy"):
            energy = kinetic_energy(g, x, self.energy_range)
        return g, energy, direction, charge

    def _network_graph(self, g: Graph, noise: str) -> str:
        network, d = self.network, self.network.d
        tokens = g("Reshape", _linear(g, network.embedding, noise), np.array([-1, 3, d], dtype=np.int64))
        tokens = g("Gelu", _norm(g, network.norm, tokens))
        for layer in network.encoder.layers:
            attended = _linear(g, layer.self_attn.out_proj, _attention(g, layer.self_attn, tokens, d))
            tokens = _norm(g, layer.norm1, g("Add", tokens, attended))
            fed = _linear(g, layer.linear2, g("Gelu", _linear(g, layer.linear1, tokens)))
            tokens = _norm(g, layer.norm2, g("Add", tokens, fed))
        return _linear(g, network.decoder, tokens)

    def _direction_graph(self, g: Graph, cos_x: str, cos_y: str) -> tuple[str, str]:
        radius = g("Sqrt", g("Add", g("Mul", cos_x, cos_x), g("Mul", cos_y, cos_y)))
        floor, inside = place(g, radius, _RADIUS_KNOTS / _RADIUS_REACH)
        cell = g("Cast", floor, to=TensorProto.INT32)
        start, slope = (look_up(g, table, cell) for table in interpolation_cells(g, self.angle))
        zenith = g("Add", start, g("Mul", inside, slope))
        stretch = g("Div", g("Sin", zenith), g("Max", radius, _SMALLEST_RADIUS))
        cos_zenith = g("Cos", zenith)
        return matrix(g, g("Mul", cos_x, stretch), g("Mul", cos_y, stretch), g("Neg", cos_zenith)), cos_zenith

    def _threshold_graph(self, g: Graph, x: str, cos_zenith: str) -> str:
        rows, cols = self.charge.values.shape
        row_position = g("Mul", g("Sub", x, self.charge.x_range[0]), self._row_scale)
        row, a = place(g, g("Clip", row_position, 0.0, rows - 1 - 1e-3), 1.0)
        column, b = place(g, g("Clip", g("Mul", cos_zenith, float(cols - 1)), 0.0, cols - 1 - 1e-3), 1.0)
        cell = g("Cast", g("Add", g("Mul", row, float(cols - 1)), column), to=TensorProto.INT32)
        return on_plane(g, [look_up(g, table, cell) for table in bilinear_cells(g, self.charge.values)], a, b)


_SMALLEST_RADIUS = 1e-12


def _weight(g: Graph, tensor: torch.Tensor) -> str:
    """Return a constant that the file stores as float16."""
    return g("Cast", tensor.detach().numpy().astype(np.float16), to=TensorProto.FLOAT)


def _linear(g: Graph, layer: torch.nn.Linear, value: str) -> str:
    return g("Add", g("MatMul", value, _weight(g, layer.weight.T.contiguous())), _weight(g, layer.bias))


def _norm(g: Graph, layer: torch.nn.LayerNorm, value: str) -> str:
    return g("LayerNormalization", value, _weight(g, layer.weight), _weight(g, layer.bias), epsilon=layer.eps)


def _attention(g: Graph, layer: torch.nn.MultiheadAttention, tokens: str, d: int) -> str:
    """Softmax(q k^T / sqrt(d / heads)) v over the three tokens, head by head."""
    projected = g(
        "Add",
        g("MatMul", tokens, _weight(g, layer.in_proj_weight.T.contiguous())),
        _weight(g, layer.in_proj_bias),
    )
    shape = np.array([-1, 3, HEADS, d // HEADS], dtype=np.int64)
    q, k, v = (g("Reshape", part, shape) for part in g.several("Split", 3, projected, axis=2, num_outputs=3))
    q, v = (g("Transpose", part, perm=[0, 2, 1, 3]) for part in (q, v))
    k = g("Transpose", k, perm=[0, 2, 3, 1])
    weights = g("Softmax", g("MatMul", g("Mul", q, (d // HEADS) ** -0.5), k), axis=3)
    together = g("Transpose", g("MatMul", weights, v), perm=[0, 2, 1, 3])
    return g("Reshape", together, np.array([-1, 3, d], dtype=np.int64))
