"""What a released model is published with: an ONNX file and its evaluation in, card, manifest and test vectors out.

Only `models/make.py` and the tests need it.
"""
