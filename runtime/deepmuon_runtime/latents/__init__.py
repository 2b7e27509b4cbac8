"""Random numbers, the same for ever: a seed and a position in, latents, counts of muons and shards of a run out.

Knows of no model and no file.
"""
