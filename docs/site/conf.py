# SPDX-License-Identifier: BSD-3-Clause
"""Settings of Sphinx for the documentation site; `build_site.py` runs Sphinx."""

from __future__ import annotations

import logging
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[2]
logging.getLogger("rospy").setLevel(logging.WARNING)  # imported, but no node runs

project = "Modular Benchmarking Framework"
author = "Modular Benchmarking Framework developers"
copyright = f"{author}, BSD-3-Clause"  # noqa: A001 - the name that Sphinx reads
release = version = ElementTree.parse(ROOT / "src/modular_framework_api/package.xml").findtext("version", "")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
root_doc = "docs/README"
source_suffix = {".md": "markdown"}
default_role = "code"
suppress_warnings = ["ref.python"]  # packages may have errors of the same name
highlight_language = "none"
smartquotes_action = "D"  # dashes only: a quotation mark in a docstring is part of a value

myst_heading_anchors = 4  # GitHub's anchors of headings

autodoc_default_options = {"members": True, "member-order": "bysource", "show-inheritance": True}
autoclass_content = "both"  # arguments are described in the docstring of __init__
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True  # a field is described once, in the section Attributes of its class
napoleon_use_rtype = False
add_module_names = False
python_use_unqualified_type_names = True
python_display_short_literal_types = True
python_maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"{project} {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
