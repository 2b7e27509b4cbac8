"""What was measured or drawn once, by hand, and is kept with its results: README.md lists it.

Uses any package, and no package uses it.
"""
