"""What every fit needs: smooth densities, the descent and its checkpoints, validation, ends of a sample, charge.

Muons in, what was learned of them out. Knows of no architecture.
"""
