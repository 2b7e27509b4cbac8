"""The `quantile` architecture: a triangular map of one-dimensional quantile functions, a muon a draw.

A sample in, maps, their tables and their graph out. Knows of no other architecture.
"""
