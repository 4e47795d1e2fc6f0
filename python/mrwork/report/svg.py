"""A figure as an SVG or PNG file, or as an element of a page."""

from __future__ import annotations

import io
import re
from html import escape

import matplotlib
from matplotlib.figure import Figure
from matplotlib.text import Text

from mrwork.escaping import escaped_lines
from mrwork.report import style

# Without a date, equal figures are equal files.
_NO_DATE = {"Date": None}
_PNG_DOTS_PER_INCH = 200


def svg_bytes(figure: Figure) -> bytes:
    """An SVG file with outlines for letters, which looks the same everywhere."""
    return _saved(figure, font_type="path").encode()


def png_bytes(figure: Figure) -> bytes:
    """A picture for a slide or a text processor, 200 dots per inch."""
    target = io.BytesIO()
    _without_controls(figure)
    with style.drawn_in_style():
        figure.savefig(target, format="png", dpi=_PNG_DOTS_PER_INCH)
    return target.getvalue()


def inline_svg(figure: Figure, *, identifier: str, description: str) -> str:
    """An `<svg>` element that scales with its column; `description` is for screen readers.

    Its letters are text in the font that the page embeds.
    `identifier` keeps the element's names apart from those of the other figures of the page.
    """
    text = _saved(figure, font_type="none")
    view_box = re.search(r'viewBox="([^"]+)"', text)
    body = text[text.index(">", text.index("<svg")) + 1 : text.rindex("</svg>")]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r"\bd=\"[^\"]*\"|<use [^>]*>", _two_decimals, body)
    body = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{identifier}-", body)
    title = f"{identifier}-title"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" role="img" '
        f'viewBox="{view_box.group(1) if view_box else "0 0 360 270"}" aria-labelledby="{title}">'
        f'<title id="{title}">{escape(description)}</title>{body}</svg>'
    )


def _saved(figure: Figure, *, font_type: str) -> str:
    target = io.StringIO()
    _without_controls(figure)
    with style.drawn_in_style(), matplotlib.rc_context({"svg.fonttype": font_type}):
        figure.savefig(target, format="svg", metadata=_NO_DATE)
    return target.getvalue()


def _without_controls(figure: Figure) -> None:
    """Show control characters of names as escapes: no font has them, and no XML may."""
    for text in figure.findobj(Text):
        text.set_text(escaped_lines(text.get_text()))


def _two_decimals(element: re.Match[str]) -> str:
    # A hundredth of a point is far below what a screen or a printer shows, and halves the page.
    return re.sub(r"(\.\d\d)\d+", r"\1", element.group())
