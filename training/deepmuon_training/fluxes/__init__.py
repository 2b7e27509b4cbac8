"""Fluxes of muons at sea level as formulas and tables, and muons drawn from them.

Whatever it comes from, a flux is a `Flux`; one sampler and one quadrature serve all. Knows of no transport, and of no
generator.
"""
