"""Muons that another program wrote: a reader gives rows under headings, one place says what they mean and makes muons.

Knows of no format of ours but text, and of no option of a command.
"""
