"""Scores: generated and held-out muons in, distances, chi-squares and verdicts out, each beside its noise.

Knows of no architecture but by the name of its targets.
"""
