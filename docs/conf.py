"""Sphinx builds the site from docs/: `make docs` writes it to frontend/dist/docs, served at /docs."""

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
sys.path.insert(0, str(ROOT / "docs" / "_extensions"))

project = "Palpebra"
author = "The Palpebra developers"
copyright = "2026, the Palpebra developers. License: GPL-3.0-or-later"
release = version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "generated_reference",
    "strict_policy",
]
exclude_patterns = ["_extensions", "reference/*.toml"]
root_doc = "index"
language = "en"
nitpicky = False

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
html_math_renderer = "mathml"

autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_favicon = "_static/favicon.svg"
html_theme = "pydata_sphinx_theme"
html_title = "Palpebra"
html_static_path = ["_static"]
html_css_files = ["palpebra.css"]
html_search_scorer = str(ROOT / "docs" / "_extensions" / "search_scorer.js")
html_show_sourcelink = False
html_copy_source = False
html_last_updated_fmt = None
html_theme_options = {
    "logo": {"text": "Palpebra"},
    "navbar_align": "left",
    "header_links_before_dropdown": 5,
    "show_toc_level": 2,
    "navigation_with_keys": True,
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_context = {"default_mode": "auto"}
# A decision's sidebar would list all the other decisions: two megabytes that nobody reads.
html_sidebars = {"index": [], "search": [], "explanation/decisions/0*": []}
copybutton_prompt_text = "$ "
suppress_warnings = ["myst.xref_missing"] if "--allow-missing" in sys.argv else []
