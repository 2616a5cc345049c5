"""Sphinx: how the pages under docs/ and the docstrings become a site. Built by ``python3 run.py docs``."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

import warpedfoam  # noqa: E402

project = "warpedfoam"
author = "The warpedfoam authors"
project_copyright = "The warpedfoam authors, MIT licence"
version = release = warpedfoam.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_design",
    "reference_pages",
    "command_pages",
    "gallery_pages",
    "name_links",
    "formulas",
]
root_doc = "index"
exclude_patterns = ["_build", "_ext", "pictures"]
html_theme = "furo"
html_title = f"warpedfoam {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False

# headings are link targets, as on a code host; "colon_fence" and "attrs" are for pages that are ours alone
myst_enable_extensions = ["colon_fence", "attrs_block", "attrs_inline"]
myst_heading_anchors = 3

# names in single backticks lead to the reference where there is an entry
default_role = "py:obj"
add_module_names = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
