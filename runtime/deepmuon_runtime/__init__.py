"""Samples cosmic-ray muons from small ONNX generators."""

import os

from deepmuon_runtime.cuts import Cuts
from deepmuon_runtime.errors import DeepMuonError, FailedError, RefusedError
from deepmuon_runtime.formats.check import check_file
from deepmuon_runtime.formats.convert import convert_file
from deepmuon_runtime.generator import Generator
from deepmuon_runtime.latents.philox import new_seed
from deepmuon_runtime.latents.shard import Shard
from deepmuon_runtime.model.metadata import Model
from deepmuon_runtime.model.released import list_models
from deepmuon_runtime.muon_file.check import Report
from deepmuon_runtime.muon_file.merge import merge_shards
from deepmuon_runtime.muon_file.reader import read_attributes, read_muons
from deepmuon_runtime.muon_file.writer import MuonWriter, write_muons
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.sampling.selection import Rate
from deepmuon_runtime.targets.box import Box
from deepmuon_runtime.targets.convex_body import ConvexBody
from deepmuon_runtime.targets.cylinder import Cylinder
from deepmuon_runtime.targets.plane import Plane
from deepmuon_runtime.targets.sphere import Sphere
from deepmuon_runtime.targets.target import Target

__all__ = [
    "Box",
    "ConvexBody",
    "Cuts",
    "Cylinder",
    "DeepMuonError",
    "FailedError",
    "Generator",
    "Model",
    "MuonWriter",
    "Muons",
    "Plane",
    "Rate",
    "RefusedError",
    "Report",
    "Shard",
    "Sphere",
    "Target",
    "check_file",
    "convert_file",
    "list_models",
    "merge_shards",
    "new_seed",
    "read_attributes",
    "read_muons",
    "write_muons",
]

# ONNX Runtime reads it once, when it is first imported, which no module here does before this one: no identifier is
# stored and nothing is sent. Whoever wants that sets it to 0.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
