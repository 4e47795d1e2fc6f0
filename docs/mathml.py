"""Sphinx extension: equations as MathML, which browsers show without scripts or fonts from elsewhere.

Docutils, on which Sphinx stands, has the converter.
"""

from __future__ import annotations

import re
from html import escape
from typing import Any
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

# Environments of whole displays by those within a formula, which the converter knows.
_DISPLAYS = re.compile(r"(\\(?:begin|end))\{(?:align|gather)\*?\}")
# Browsers put function and argument side by side without the invisible sign, and bars close to what they enclose.
_REPLACED = (
    (' xmlns="http://www.w3.org/1998/Math/MathML"', ""),  # a page needs no name space
    ("<mo>&ApplyFunction;</mo>", '<mspace width="0.1em"></mspace>'),
    ('<mo stretchy="false">|</mo>', '<mo stretchy="false" lspace="0" rspace="0">|</mo>'),
)
_ACCENTS = frozenset("˙¨ˆ˜¯→")
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
    text = _DISPLAYS.sub(r"\1{aligned}", node.astext())
    if is_block and "\\\\" in text and "\\begin" not in text:
        text = f"\\begin{{aligned}}\n{text}\n\\end{{aligned}}"
    try:
        found = str(tex2mathml(text, as_block=is_block))
    except MathError as error:
        _LOG.warning("the equation %r cannot be shown: %s", text, error, location=node)
        return f"<code>{escape(text)}</code>"
    for old, new in _REPLACED:
        found = found.replace(old, new)
    tree = ElementTree.fromstring(found)
    for element in tree.iter("munderover"):
        if element[2].text in _ACCENTS:
            _put_beside(element)
    return ElementTree.tostring(tree, encoding="unicode", short_empty_elements=False)


def _put_beside(element: ElementTree.Element) -> None:
    """Put the index of a letter with an accent beside it, which the converter has put below."""
    letter, index, accent = element
    accented = ElementTree.Element("mover", accent="true")
    accented.extend((letter, accent))
    element.tag = "msub"
    element[:] = [accented, index]
