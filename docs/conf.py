"""Configuration of Sphinx: `make docs` builds the site into docs/_build."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from perception import __version__  # noqa: E402 - of this source tree

project = "Trifuse"
copyright = "2026, the Trifuse developers"
release = version = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"Trifuse {__version__}"
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "undoc-members": False}
napoleon_google_docstring = True
napoleon_use_ivar = True
napoleon_attr_annotations = False
# Links from documents to files of the source tree are links there, not pages of the site.
suppress_warnings = ["myst.xref_missing"]
