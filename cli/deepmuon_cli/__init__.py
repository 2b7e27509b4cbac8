"""Thin click commands over the DeepMuon libraries."""
