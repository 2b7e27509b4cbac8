"""Muons at great depth: two engines against each other, and both against what was measured."""
