"""What generating muons takes on this machine, beside other ways to muons and in other engines.

Programs in; tables, numbers and a chart out.
"""
