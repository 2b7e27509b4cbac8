"""Muons in HDF5: columns and attributes in, a muon file out, and back; checked, merged, and described.

What a file says of its model is compared with the released ones; no model is run here.
"""
