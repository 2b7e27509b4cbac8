"""Muons made in a GPU's memory from the random numbers on, where CuPy is installed: kernels, runs, columns.

Only what needs CuPy may enter; the rest of the package does without it, and imports this room where it is wanted.
"""
