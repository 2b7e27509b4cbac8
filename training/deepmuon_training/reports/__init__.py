"""Evaluations for people: scores and counts in, pictures and HTML out.

Nothing is computed here that is not in the evaluation.
"""
