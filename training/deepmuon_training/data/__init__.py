"""Muons to learn from: files of CRY and of other programs and formulas in, samples out.

Knows of no transport, and of no generator.
"""
