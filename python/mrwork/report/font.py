"""The font of all figures: DejaVu Sans as matplotlib ships it, so that text has the same size on every machine.

Figures name the family `FAMILY`, which exists only here: for matplotlib it is these two files and never a font of the
system, for a browser the subset that the page contains.
"""

from __future__ import annotations

import base64
import io
from functools import cache
from pathlib import Path

import matplotlib
from matplotlib import font_manager

FAMILY = "mrwork figures"
# What matplotlib calls the same files where it sets mathematics.
SHIPPED_FAMILY = "DejaVu Sans"

_FILES = {400: "DejaVuSans.ttf", 700: "DejaVuSans-Bold.ttf"}
# ASCII, Latin with accents, Greek, and the punctuation and mathematical signs of labels.
_CHARACTERS = (
    *(range(0x20, 0x7F), range(0xA0, 0x100), range(0x391, 0x3CA), range(0x2070, 0x208F)),
    [ord(sign) for sign in "\u2002\u2007\u2009\u202f–—‘’“”•…′″←→∂∆∈−∙√∝∞∫≈≠≤≥"],
)


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
        f"src: url(data:font/woff;base64,{_subset(path_of(weight))}) format('woff'); }}\n"
        for weight in _FILES
    )


def _subset(path: Path) -> str:
    # Slow to load, and only pages need it.
    from fontTools import subset

    options = subset.Options(flavor="woff", layout_features=["kern"], hinting=False)
    options.drop_tables = [*options.drop_tables, "FFTM"]
    font = subset.load_font(io.BytesIO(path.read_bytes()), options)
    subsetter = subset.Subsetter(options)
    subsetter.populate(unicodes=[code for characters in _CHARACTERS for code in characters])
    subsetter.subset(font)
    target = io.BytesIO()
    subset.save_font(font, target, options)
    return base64.b64encode(target.getvalue()).decode("ascii")
