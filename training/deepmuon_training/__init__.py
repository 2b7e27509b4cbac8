"""Trains DeepMuon generators and exports them to ONNX."""

import deepmuon_runtime  # noqa: F401 - before ONNX Runtime, whose telemetry it turns off
