"""Files of any kind that are complete under their name, or not there: bytes in, a published file out.

Knows neither muons nor models.
"""
