"""Which release this is: of deepmuon-runtime, and of deepmuon-training, which needs the same."""

__all__ = ["VERSION"]

VERSION = "0.2.0"
"""A constant, because looking it up in what is installed takes a tenth of a command's start."""
