"""What several studies have in common: generators, scores, processes that are measured, and how results are written.

Knows of no study.
"""
