"""The font of all figures: DejaVu Sans as matplotlib ships it, so that text has the same size on every machine.

Figures name the family `FAMILY`, which exists only here: for matplotlib it is these two files and never a font of the
system, for a browser the subset that the page contains. The subsets are files of the package, because making one takes
half a second; `tests/report/test_figure_font.py` makes them, and checks that they are those of matplotlib's files.
"""

from __future__ import annotations

import base64
from functools import cache
from importlib.resources import files
from pathlib import Path

import matplotlib
from matplotlib import font_manager

FAMILY = "mrwork figures"

_FILES = {400: "DejaVuSans.ttf", 700: "DejaVuSans-Bold.ttf"}


def path_of(weight: int) -> Path:
    """The font file of a weight, 400 or 700."""
    return Path(matplotlib.get_data_path()) / "fonts" / "ttf" / _FILES[weight]


@cache
def register() -> None:
    """Make the family known to matplotlib, once."""
    for weight in _FILES:
        font_manager.fontManager.ttflist.append(
            font_manager.FontEntry(
                fname=str(path_of(weight)),
                name=FAMILY,
                style="normal",
                variant="normal",
                weight=weight,
                stretch="normal",
                size="scalable",
            )
        )


@cache
def font_faces() -> str:
    """CSS that embeds the family in a page, with the characters that figures use; about 50 kB."""
    return "".join(
        f'@font-face {{ font-family: "{FAMILY}"; font-weight: {weight}; '
        f"src: url(data:font/woff;base64,{_subset(weight)}) format('woff'); }}\n"
        for weight in _FILES
    )


def subset_name(weight: int) -> str:
    """Name of the subset of a weight among the templates of the pages."""
    return f"figures-{weight}.woff"


def _subset(weight: int) -> str:
    file = files("mrwork.report") / "templates" / subset_name(weight)
    return base64.b64encode(file.read_bytes()).decode("ascii")
