"""How Sphinx builds the site; ``python docs/make_site.py`` runs it. Nothing is downloaded while reading."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as version_of
from pathlib import Path

from deepmuon_training.transport.geant4_data import without_data_sets

sys.path[:0] = [str(Path(__file__).parent / "_extensions"), str(Path(__file__).parents[1])]  # the latter for studies
os.environ.update(without_data_sets())  # for the modules that import geant4_pybind

project = "DeepMuon"
author = "The DeepMuon developers"
copyright = f"2026, {author}"
release = version = version_of("deepmuon-runtime")

extensions = [
    "floor_plan",
    "include_all",
    "live_page",
    "mathml",
    "myst_parser",
    "released_models",
    "score_summary",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_click",
]
exclude_patterns = ["_build"]
default_role = "py:obj"  # `name` in a docstring is Python's
smartquotes = False  # options have two dashes

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True}
napoleon_google_docstring = False

html_theme = "furo"
html_favicon = "images/favicon.svg"
html_title = f"DeepMuon {version}"
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
