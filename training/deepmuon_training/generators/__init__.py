"""Generators by architecture: a sample in, a trained generator out, and from it an ONNX file, and back.

An architecture is one folder. Knows of no pipeline and no report.
"""
