"""ONNX files that keep the contract: a generator's stored numbers and graph in, a file that was compared out.

Knows of no architecture, and needs no trainer.
"""
