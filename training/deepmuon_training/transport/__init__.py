"""Muons through matter: a sample above a slab in, the sample below it out, carried by Geant4 in processes of its own.

Geant4 is imported in those processes alone. Knows of no generator.
"""
