"""What a family of any kind of map needs: interpolation in depth, its rates, and the flux through a sphere.

Numbers in, numbers or nodes of a graph out; knows of no architecture.
"""
