"""The documentation site: ``make docs`` builds it into site/, and any warning stops it.

Pages are Markdown; what code says of itself is taken from its docstrings, so that it stands once.
Nothing is asked of any other host: the theme has no web fonts, and equations are MathML.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

import hdc

project = "hdc"
author = "the contributors"
project_copyright = author
release = hdc.__version__

extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon", "myst_parser"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say more: shapes and units
autodoc_inherit_docstrings = False
napoleon_use_rtype = False
# A page shows chosen modules: what their docstrings mention of others is code, not a link.
suppress_warnings = ["ref.python"]

toc_object_entries = False
html_theme = "alabaster"
html_title = f"hdc {release}"
html_theme_options = {
    "description": "Optical hyperdimensional sensing",
    "fixed_sidebar": False,
    "show_powered_by": False,
}
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_math_renderer = "mathml"


def _inline(visitor: Any, node: nodes.math) -> None:
    visitor.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _display(visitor: Any, node: nodes.math_block) -> None:
    visitor.body.append(
        f'<div class="equation">{convert(node.astext(), display="block")}</div>'
    )
    raise nodes.SkipNode


def setup(app: Any) -> None:
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
