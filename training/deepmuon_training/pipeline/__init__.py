"""The loop of the paper: a sample and settings in, a generator for every depth out, resumable at each step.

Knows of no architecture but by name.
"""
