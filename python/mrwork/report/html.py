"""Self-contained HTML pages: templates with their content, the style sheet, names and equations as mathematics."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from mrwork.base.table import breakable, format_code
from mrwork.errors import escaped_lines
from mrwork.plots import style
from mrwork.report.section import Lead, Section
from mrwork.store.run_folder import DATA, REPORT, SUMMARY
from mrwork.store.run_writer import add_to_run

_FUNCTIONS = ("sgn", "sign", "tanh", "exp", "ln", "log", "sqrt", "sin", "cos", "abs", "max", "min", "sat")

_TOKEN = re.compile(
    r"(?P<kept></?(?:sub|sup|i|b|em|strong|br)\s*/?>|\[[AV]\])"
    r"|\^\((?P<power>[^()]*)\)"
    r"|\^(?P<exponent>-?\w+)"
    r"|(?P<name>[A-Za-z]\w*(?:\.\d)?)(?P<primes>'*)"
    r"|(?P<minus>-)"
    r"|(?P<other>.)",
    re.DOTALL,
)


def symbol(name: str) -> str:
    """A parameter's name as a symbol: `k_w` as k with subscript w, `alpha` as its Greek letter.

    A coefficient of a current law has its number as one more subscript: `k_w.1`; a value at a command tells it.
    """
    name, at, command = style.at_command(name)
    if at:
        return symbol(name) + escape(at + command)
    name, dot, coefficient = name.partition(".")
    match = re.fullmatch(r"([A-Za-z]+?)_?(\d\w*|(?<=_).+)?", name)
    base, subscript = match.groups() if match else (name, None)
    letter = style.GREEK.get(base, base)
    if match is None or len(letter) > 1:
        return escape(name + dot + coefficient)
    subscripts = [part for part in (style.GREEK.get(subscript or "", subscript), coefficient) if part]
    set_subscript = f"<sub>{escape(','.join(subscripts))}</sub>" if subscripts else ""
    return f"<i>{escape(letter)}</i>{set_subscript}"


def equation_html(equation: str) -> str:
    """An equation as HTML: Greek letters, subscripts, powers and a true minus.

    A few simple tags (`sub`, `sup`, `i`, `b`, `br`) pass through; everything else is escaped.
    """
    return "".join(_mark_up(match) for match in _TOKEN.finditer(equation.strip()))


def _mark_up(match: re.Match[str]) -> str:
    power = match["exponent"] if match["power"] is None else match["power"]
    if power is not None:
        return f"<sup>{equation_html(power)}</sup>"
    if name := match["name"]:
        # A symbol where it has the form of one; functions and words as they are.
        is_symbol = re.fullmatch(r"[A-Za-z]|[A-Za-z]+(\d\w*|_\w+|(\w*\.\d))", name) or name in style.GREEK
        shown = symbol(name) if is_symbol and name not in _FUNCTIONS else escape(name)
        return shown + "′" * len(match["primes"])
    return match["kept"] or ("\N{MINUS SIGN}" if match["minus"] else escape(match["other"]))


class Page(str):
    """HTML of a page; `files` are the CSV files beside it, with what its `figures` draw, by their paths."""

    files: Mapping[str, bytes]
    figures: Mapping[str, Figure]

    def write(self, folder: Path, *, summary: bool = False) -> Path:
        """Write it and its files into the folder of its run; a `summary` is its front alone."""
        name = SUMMARY if summary else REPORT
        add_to_run(folder, {name: self.encode(), **self.files})
        return folder / name


def page_html(lead: Lead, sections: Sequence[Section | None] = ()) -> Page:
    """A page: its front, and its sections without those that are `None`; control characters are shown as escapes."""
    shown = [section for section in sections if section is not None]
    template = _environment().from_string(_resource("page.html.j2"))
    page = Page(escaped_lines(template.render(lead=lead, sections=shown)))
    groups = [group for section in shown for group in section.groups]
    panels = [*lead.panels, *(panel for group in groups for panel in group.panels)]
    page.files = {f"{DATA}/{panel.name}.csv": panel.data.encode() for panel in panels if panel.data}
    page.figures = {panel.name: panel.figure for panel in panels if panel.figure is not None}
    return page


def _resource(name: str) -> str:
    return (files("mrwork.report") / "templates" / name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    """Jinja's environment for all pages: everything is escaped, and an undefined name is an error."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.globals["styles"] = Markup(style.font_faces() + style.variables() + _resource("report.css"))
    environment.filters["breakable"] = lambda name: Markup(breakable(name))
    environment.filters["coded"] = lambda sentence: Markup(format_code(sentence))
    environment.filters["symbol"] = lambda name: Markup(symbol(name))
    return environment
