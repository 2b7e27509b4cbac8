"""What every network needs to learn: monotone maps, the descent and its checkpoints, validation, tails, charge.

Muons and networks in, trained networks out. Knows of no architecture.
"""
