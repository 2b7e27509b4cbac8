"""The formats that muons are written in beside HDF5, and read back from: MCPL, ROOT and text.

Columns and attributes in, a published file out, and back; one description a format, found by the end of a name.
"""
