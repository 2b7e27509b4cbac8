"""How Sphinx builds the site; ``python docs/make_site.py`` runs it. Nothing is downloaded while reading."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as version_of
from pathlib import Path

DOCS = Path(__file__).parent
# The training package is read from its sources: installing it would bring PyTorch and Geant4. The root is for studies.
sys.path[:0] = [str(DOCS / "_extensions"), str(DOCS.parent), str(DOCS.parent / "training")]

from deepmuon_training.transport.geant4_data import without_data_sets  # noqa: E402 - from the sources

os.environ.update(without_data_sets())  # where Geant4 is installed, its import would ask for a download

project = "DeepMuon"
author = "The DeepMuon developers"
copyright = f"2026, {author}"
release = version = version_of("deepmuon-runtime")

extensions = [
    "click_examples",
    "floor_plan",
    "include_all",
    "live_page",
    "mathml",
    "myst_parser",
    "quality",
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
autodoc_mock_imports = ["geant4_pybind", "onnx", "torch"]  # gigabytes that a page does not need
autodoc_typehints = "signature"
autodoc_default_options = {"members": True}
napoleon_google_docstring = False

html_theme = "furo"
html_favicon = "images/favicon.svg"
html_title = f"DeepMuon {version}"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
