"""How Sphinx makes the site. `make site` builds it; it asks nothing of a network, nor does what it builds."""

import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

from tablegen.version import __version__

sys.path.insert(0, str(Path(__file__).parent))

project = "tablegen"
release = version = __version__
html_title = f"tablegen {release}"
root_doc = "index"
extensions = ["myst_parser", "formulas"]
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4
html_theme = "furo"
html_theme_options = {"source_view_link": "", "navigation_with_keys": True}
html_math_renderer = "mathml"
html_static_path = [str(Path(__file__).parent / "static")]
html_css_files = ["site.css"]
html_js_files = ["copy.js"]
html_copy_source = html_show_sourcelink = html_show_copyright = html_show_sphinx = False
highlight_language = "text"
pygments_style, pygments_dark_style = "tango", "github-dark"


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.add_lexer("csv", TextLexer)
