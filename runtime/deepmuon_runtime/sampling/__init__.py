"""Muons by their numbers: a loaded model, cuts and a target in, columns and rates out, the same for ever.

What is drawn, kept and rejected is decided here. Knows of no muon file.
"""
