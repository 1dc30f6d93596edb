"""The documentation site: the repository's Markdown, and the API from its docstrings.

The files stay where they are and as a Git host shows them; the source folder is the repository.
"""

import sys
from pathlib import Path

import nbv

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))

project = "nbv"
author = "The nbv developers"
project_copyright = author
version = release = nbv.__version__
language = "en-GB"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.linkcode",
    "nbv_site.api",
    "nbv_site.equations",
    "nbv_site.imports",
    "nbv_site.navigation",
    "nbv_site.sources",
]

root_doc = "README"
DOCUMENTS = {"README.md", "CONTRIBUTING.md", "CODE_OF_CONDUCT.md", "SECURITY.md", "CHANGELOG.md"}
DOCUMENTS |= {"config", "docs", "studies"}
exclude_patterns = [path.name for path in ROOT.iterdir() if path.name not in DOCUMENTS]

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math", "mermaid"]
myst_heading_anchors = 4
# A table that a run wrote begins with a heading of the second level.
suppress_warnings = ["myst.header"]
html_math_renderer = "mathml"
# Indented blocks are commands, and what they print.
highlight_language = "none"

default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
# A default that is a table of the paper is shown by its name.
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False
python_display_short_literal_types = True

html_theme = "furo"
html_title = "nbv"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
