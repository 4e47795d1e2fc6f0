"""Sphinx: what the pages are made of. `make docs` builds them; nothing on them is fetched from elsewhere."""

from __future__ import annotations

import sys
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))

import mrwork as mr  # noqa: E402 - the path comes first
from generate import pages  # noqa: E402 - the path comes first

pages.write(DOCS)

project = "mrwork"
author = "the mrwork developers"
version = release = mr.__version__
copyright = ""
extensions = [
    "sphinx.ext.autodoc",
    "numpydoc",
    "myst_nb",
    "sphinx_design",
    "sphinx_copybutton",
    "mathml",
    "python_names",
]
exclude_patterns = ["generate", "**/.ipynb_checkpoints"]
root_doc = "index"
nitpicky = True
# Types of other libraries, whose pages would have to be fetched, and of names that are not public.
nitpick_ignore_regex = [(r"py:.*", r".*")]
suppress_warnings = [
    "config.cache",
    # A README has the headings that suit it alone.
    "myst.header",
]

myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath", "substitution"]
myst_heading_anchors = 3
myst_substitutions = {"models": len(mr.damper_models()), "laws": len(mr.control.control_laws())}
html_math_renderer = "mathml"

nb_execution_mode = "cache"
nb_execution_cache_path = str(DOCS.parent / "out" / "docs" / "notebooks")
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_ipywidgets_js: dict[str, dict[str, str]] = {}

autodoc_default_options = {"member-order": "bysource"}
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"Floats": "ndarray"}
python_use_unqualified_type_names = True
maximum_signature_line_length = 72
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
default_role = "py:obj"
# Two hyphens begin an option.
smartquotes = False

html_theme = "pydata_sphinx_theme"
html_title = f"mrwork {version}"
html_static_path = ["_static"]
html_css_files = ["mrwork.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_domain_indices = False
html_theme_options = {
    "logo": {"text": "mrwork"},
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "navbar_persistent": ["search-button"],
    "show_prev_next": False,
    "footer_start": [],
    "footer_end": ["sphinx-version"],
    "secondary_sidebar_items": ["page-toc"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars = {"index": []}
copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True


def setup(app: Sphinx) -> None:
    """Read pages with index entries anew every time: a search that Sphinx 9 updates loses those of other pages."""
    marked = (path for path in DOCS.rglob("*.md") if "```{index}" in path.read_text())
    names = [path.relative_to(DOCS).with_suffix("").as_posix() for path in marked]
    app.connect("env-get-outdated", lambda *_: names)
