"""Trains DeepMuon generators and exports them to ONNX."""
