"""How sphinx builds the site: the pages of this folder, and the reference of the Python API from the docstrings."""

from __future__ import annotations

from springmass import __version__

project = "springmass"
author = "The springmass authors"
release = version = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
root_doc = "site"
exclude_patterns = ["decisions/0000-template.md", "_build"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = f"springmass {version}"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say type, shape and unit
napoleon_google_docstring = False
napoleon_use_ivar = True
# Links to files of the repository outside this folder, and to the notebook, are valid there; a test checks them.
suppress_warnings = ["myst.xref_missing"]
