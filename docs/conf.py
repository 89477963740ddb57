"""How Sphinx makes the site of these pages (``make docs``).

Sphinx with MyST and Furo: JAX, NumPy and SciPy document themselves so, a name's page is made of its docstring,
notebooks are shown with their outputs, and a page needs nothing from elsewhere. What :mod:`generated_pages` writes
is not in the repository.
"""

import sys
from importlib.metadata import version as installed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "inertia-uq"
author = "the inertia-uq developers"
version = release = installed("inertia-uq")
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "generated_pages"]
exclude_patterns = ["_build", "jupyter_execute"]
nb_execution_mode = "off"
myst_enable_extensions = ["deflist"]  # no formulas: what draws them would be fetched
myst_heading_anchors = 3
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "inherited-members": False}
html_theme = "furo"
html_title = f"inertia-uq {release}"
html_show_sphinx = False
html_copy_source = False
html_static_path, html_css_files = ["static"], ["pictures.css"]
pygments_style, pygments_dark_style = "a11y-high-contrast-light", "a11y-high-contrast-dark"
html_show_copyright = False

FOR_READERS_BY_EAR_AND_KEYBOARD = {
    'role="heading">': 'role="heading" aria-level="2">',
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="Site">',
    '<aside class="toc-drawer">': '<aside class="toc-drawer" aria-label="This page">',
    "<pre>": '<pre tabindex="0">',
    "<p><img ": '<p class="picture" tabindex="0"><img ',
}
"""What the theme leaves out: levels of headings, names of landmarks, code and pictures that a keyboard can move."""


def _completed(app, error):
    for page in () if error else Path(app.outdir).rglob("*.html"):
        text = page.read_text("utf-8")
        for theirs, ours in FOR_READERS_BY_EAR_AND_KEYBOARD.items():
            text = text.replace(theirs, ours)
        page.write_text(text, "utf-8")


def setup(app):
    """Complete the pages once they are built."""
    app.connect("build-finished", _completed)
