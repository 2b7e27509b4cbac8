"""The paper's experiments, and those that it suggests: samples and models in; numbers, tables and pictures out.

Each study is one script; docs/paper.md and docs/speed.md tell what it found.
"""
