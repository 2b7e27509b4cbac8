"""How a command runs and ends: exceptions, signals and a broken stdout in, an exit code and one line out.

Knows of no command.
"""
