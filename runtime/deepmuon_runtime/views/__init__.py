"""Muons as others want to see them: a muon file or a generator in, text, counts, pictures, Dask arrays out.

Nothing else in the package imports these, and matplotlib and Dask are needed here alone.
"""
