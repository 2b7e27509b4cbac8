"""`deepmuon-train`: words of the command line in, one call of the library and a line of text out.

Nothing imports this room.
"""
