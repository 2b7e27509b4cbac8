"""The `transformer` architecture of the paper: d muons a draw, trained with the sliced Wasserstein distance.

A sample in, a network and its graph out. Knows of no other architecture.
"""
