"""ONNX models: a file or the name of a released model in, a session that is known to keep the contract out.

A stranger's file is looked through before ONNX Runtime sees it. Knows of no muon file.
"""
