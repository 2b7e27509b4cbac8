"""What muons hit: a plane, or a convex body that they enter. A shape and directions in, areas and places out.

Knows of no model and no file.
"""
