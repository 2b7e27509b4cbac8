"""What a released model is published with: an ONNX file and its evaluation in, card, manifest and test vectors out.

Only the programs in `models/` and the tests need it.
"""
