"""A figure as an SVG or PNG file, or as an element of a page."""

from __future__ import annotations

import io
from html import escape

import matplotlib
from matplotlib.figure import Figure
from matplotlib.text import Text

from mrwork.escaping import escaped_lines
from mrwork.report import style
from mrwork.report.svg_renderer import drawn_for_page

# Without a date, equal figures are equal files.
_NO_DATE = {"Date": None}
_PNG_DOTS_PER_INCH = 200


def svg_bytes(figure: Figure) -> bytes:
    """An SVG file with outlines for letters, which looks the same everywhere."""
    target = io.BytesIO()
    _without_controls(figure)
    with style.drawn_in_style(), matplotlib.rc_context({"svg.fonttype": "path"}):
        figure.savefig(target, format="svg", metadata=_NO_DATE)
    return target.getvalue()


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
    drawn = drawn_for_page(figure, identifier)
    title = f"{identifier}-title"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" role="img" '
        f'viewBox="0 0 {drawn.width:.6g} {drawn.height:.6g}" stroke-linejoin="round" aria-labelledby="{title}">'
        f'<title id="{title}">{escape(description)}</title>{drawn.body}</svg>'
    )


def _without_controls(figure: Figure) -> None:
    """Show control characters of names as escapes: no font has them, and no XML may."""
    for text in figure.findobj(Text):
        text.set_text(escaped_lines(text.get_text()))
