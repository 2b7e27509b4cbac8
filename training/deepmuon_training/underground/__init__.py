"""Muons at any depth under a flux: mulder carries them back to the surface, and the flux weighs them there.

Mulder is an extra of the package and is imported only where it is used. Knows of no generator.
"""
