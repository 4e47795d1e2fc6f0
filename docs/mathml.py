"""Sphinx extension: equations as MathML, which browsers show without scripts or fonts from elsewhere.

Docutils, on which Sphinx stands, has the converter.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

_LOG = logging.getLogger(__name__)


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the renderer, which `html_math_renderer = "mathml"` chooses."""
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(page: Any, node: nodes.math) -> None:
    page.body.append(_mathml(node, is_block=False))
    raise nodes.SkipNode


def _block(page: Any, node: nodes.math_block) -> None:
    page.body.append(page.starttag(node, "div", CLASS="math notranslate"))
    if number := node.get("number"):
        page.body.append(f'<span class="eqno">({number})')
        page.add_permalink_ref(node, "Link to this equation")
        page.body.append("</span>")
    page.body.append(f"{_mathml(node, is_block=True)}</div>\n")
    raise nodes.SkipNode


def _mathml(node: nodes.Element, *, is_block: bool) -> str:
    text = node.astext()
    if is_block and "\\\\" in text and "\\begin" not in text:
        text = f"\\begin{{aligned}}\n{text}\n\\end{{aligned}}"
    try:
        # Browsers put function and argument side by side without the invisible sign.
        return str(tex2mathml(text, as_block=is_block)).replace(
            "<mo>&ApplyFunction;</mo>", "<mspace width='0.1em'/>"
        )
    except MathError as error:
        _LOG.warning("the equation %r cannot be shown: %s", text, error, location=node)
        return f"<code>{text}</code>"
