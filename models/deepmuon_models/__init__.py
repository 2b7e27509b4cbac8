"""The released DeepMuon generators: ONNX files, their manifest and a card for each."""
