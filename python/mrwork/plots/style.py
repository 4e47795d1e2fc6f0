"""The style of figures and pages: colours, the font that ships with matplotlib, sizes, and the units of axes.

Data are grey, the model is blue and the residual rust.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib
import numpy as np
from matplotlib import font_manager
from matplotlib.colors import LinearSegmentedColormap, to_rgb

from mrwork.base.keys import look_up

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType


FAMILY = "mrwork figures"

_FILES = {400: "DejaVuSans.ttf", 700: "DejaVuSans-Bold.ttf"}


def path_of(weight: int) -> Path:
    """The font file of a weight, 400 or 700."""
    return Path(matplotlib.get_data_path()) / "fonts" / "ttf" / _FILES[weight]


@cache
def register() -> None:
    """Make the family known to matplotlib, once."""
    for weight in _FILES:
        font = font_manager.FontEntry(fname=str(path_of(weight)), name=FAMILY, weight=weight, size="scalable")
        font_manager.fontManager.ttflist.append(font)


@cache
def font_faces() -> str:
    """CSS that embeds the family in a page, with the characters that figures use; about 50 kB."""
    templates = files("mrwork.plots")
    subsets = {weight: base64.b64encode((templates / subset_name(weight)).read_bytes()) for weight in _FILES}
    return "".join(
        f'@font-face {{ font-family: "{FAMILY}"; font-weight: {weight}; '
        f"src: url(data:font/woff;base64,{subset.decode()}) format('woff'); }}\n"
        for weight, subset in subsets.items()
    )


def subset_name(weight: int) -> str:
    """Name of the subset of a weight among the templates of the pages."""
    return f"figures-{weight}.woff"


PALETTE: Final = {
    "page": ("#ffffff", "#14181e"),
    "ink": ("#1b2329", "#e4e9eb"),
    "faint-ink": ("#59626a", "#a8b3ba"),
    "rule": ("#d5dade", "#333d45"),
    "window": ("#eef2f5", "#20282e"),
    "alert-tint": ("#fbf1ec", "#33231b"),
    "data": ("#89949c", "#748088"),
    "model": ("#0a5a96", "#65ade8"),
    "residual": ("#b0502a", "#e0845a"),
    "green": ("#378d60", "#66e9a8"),
    "amber": ("#c08720", "#efc246"),
    "violet": ("#a260d7", "#8b69dd"),
    "wine": ("#7b373f", "#da2c71"),
    # The prediction band is light and wide, the parameter band dark and narrow.
    "band": ("#d9e6f0", "#1c3247"),
    "band-edge": ("#5a94c3", "#416b8f"),
}
"""Colours by name, on a light and on a dark page.

Colours of curves, from `data` to `wine` and both inks, are 12 apart (CIEDE2000) from each other to eyes of all kinds,
and `band-edge` from the colours beside it. All have the contrast 3:1 to the page (`tests/report/test_look.py`).
"""

PAGE, INK, FAINT_INK, RULE, WINDOW, _, DATA, MODEL, RESIDUAL, *_HUES, BAND, BAND_EDGE = (
    light for light, _ in PALETTE.values()
)
HUES = (MODEL, RESIDUAL, *_HUES)
"""Colours of laws, see `hue`."""
# Colours that scales of quantities blend.
_BLENDS = ((BAND_EDGE, MODEL), (MODEL, INK), (PAGE, MODEL))


def hue(number: int) -> str:
    """Colour of a curve by its number in a panel: a hue of its own, or the grey of those without."""
    return HUES[number] if number < len(HUES) else DATA


def variables() -> str:
    """CSS that names the colours, dark ones where the reader's system is dark; paper is light."""
    light, dark = ("".join(f"--{name}: {both[side]};" for name, both in PALETTE.items()) for side in (0, 1))
    return f":root {{{light}}}\n@media screen and (prefers-color-scheme: dark) {{:root {{{dark}}}}}\n"


def in_variables(svg: str) -> str:
    """A drawing with the names of its colours instead of the colours, so that it follows the page."""
    return _COLOUR.sub(lambda colour: _variable(colour[0]), svg)


@cache
def _variable(colour: str) -> str:
    """A colour, as `#rrggbb`, by its name or as a blend of two with names; any other as it is."""
    if colour in _NAMES:
        return f"var(--{_NAMES[colour]})"
    for ends in _BLENDS:
        start, end, wanted = (np.array(to_rgb(end)) for end in (*ends, colour))
        share = float(np.dot(wanted - start, end - start) / np.dot(end - start, end - start))
        if 0.0 < share < 1.0 and np.abs(start + share * (end - start) - wanted).max() < 1.0 / 255.0:
            near, far = (_NAMES[end] for end in ends)
            return f"color-mix(in srgb,var(--{far}) {100.0 * share:.1f}%,var(--{near}))"
    return colour


_NAMES = {light: name for name, (light, _) in PALETTE.items()}
_COLOUR = re.compile(r"(?<=: )#[0-9a-f]{6}(?=[;\"])")


# From light to dark, for quantities and for tests in their order.
TONES = LinearSegmentedColormap.from_list("mrwork", [BAND_EDGE, MODEL, INK])

# Size of a panel [in]: as wide as one of two columns on a desktop screen and as a whole telephone
# screen, so that one drawing is legible on both.
PANEL_WIDTH = 5.0
PANEL_HEIGHT = 3.75

# Patterns of lines that are limits or references, in units of their width.
DOTTED = (0, (1.2, 1.8))
DASHED = (0, (4, 3))

# Font sizes [pt]. The letters of this font are large for their nominal size.
TEXT_SIZE = 9.5
SMALL_TEXT_SIZE = 9.1

_RC: dict[RcKeyType, Any] = {
    "font.family": [FAMILY],
    # Names of files, tests and laws are text: a dollar sign is a dollar sign.
    "text.parse_math": False,
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), TEXT_SIZE),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), SMALL_TEXT_SIZE),
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.titlecolor"), INK),
    **dict.fromkeys(("xtick.labelcolor", "ytick.labelcolor"), INK),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), FAINT_INK),
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "axes.axisbelow": True,
    # Without this, matplotlib lays out all tick labels twice to find a place for the title.
    "axes.titley": 1.0,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "grid.color": RULE,
    "grid.linewidth": 0.6,
    "xtick.major.size": 3.5,
    "ytick.major.size": 0.0,
    "xtick.major.width": 0.7,
    "ytick.major.pad": 5.0,
    **dict.fromkeys(("lines.solid_capstyle", "lines.solid_joinstyle"), "round"),
    "legend.frameon": False,
    **dict.fromkeys(("legend.borderaxespad", "legend.borderpad"), 0.0),
    "legend.handlelength": 1.5,
    "legend.handletextpad": 0.5,
    "legend.columnspacing": 1.3,
    **dict.fromkeys(("figure.facecolor", "savefig.facecolor"), "white"),
    "path.simplify": True,
    "path.simplify_threshold": 0.25,
    "svg.hashsalt": "mrwork",
    "svg.fonttype": "none",
}


@contextmanager
def drawn_in_style() -> Iterator[None]:
    """Matplotlib settings of all figures, as a context or a decorator; the caller's settings are restored."""
    register()
    with matplotlib.rc_context(_RC):
        yield
        interactive = matplotlib.is_interactive()
    # With the first figure pyplot chooses how a notebook shows them all.
    matplotlib.interactive(interactive)


@dataclass(frozen=True, slots=True, kw_only=True)
class DisplayUnit:
    """A unit for display: an SI value times `factor` is the number in units of `symbol`."""

    symbol: str
    factor: float


MILLIMETRE = DisplayUnit(symbol="mm", factor=1e3)
MILLIMETRE_PER_SECOND = DisplayUnit(symbol="mm/s", factor=1e3)
FORCES = tuple(
    DisplayUnit(symbol=symbol, factor=factor)
    for symbol, factor in (("kN", 1e-3), ("N", 1.0), ("mN", 1e3), ("µN", 1e6), ("nN", 1e9))
)


def force_unit(peak_force: float, symbol: str | None = None) -> DisplayUnit:
    """The unit of this symbol, or newton for forces of up to four digits, kilonewton above, smaller below a tenth."""
    if symbol is not None:
        units = {unit.symbol: unit for unit in FORCES}
        return look_up(symbol, units, f"no force is drawn in {symbol!r}", otherwise="units are")
    largest = FORCES[0] if peak_force >= 1e4 else FORCES[1]
    return residual_unit(peak_force, largest, least=0.1)


def residual_unit(peak_residual: float, unit: DisplayUnit, *, least: float = 0.01) -> DisplayUnit:
    """The `unit` of the force, or the first smaller one in which the peak is not below `least`."""
    if peak_residual == 0:
        return unit
    candidates = FORCES[FORCES.index(unit) :]
    large_enough = (finer for finer in candidates if peak_residual * finer.factor >= least)
    return next(large_enough, FORCES[-1])


def shown_unit(unit: str) -> str:
    """A unit with no-break spaces and raised powers; empty for a dimensionless quantity."""
    if unit in {"", "-", "1"}:
        return ""
    return unit.replace(" ", "\N{NO-BREAK SPACE}").replace("^2", "²").replace("^3", "³")


def with_unit(name: str, unit: str) -> str:
    """A name for an axis, with its unit in parentheses if it has one."""
    shown = shown_unit(unit)
    return f"{name} ({shown})" if shown else name


GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η", "theta": "θ",
    "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω",
}  # fmt: skip
"""Letters of the equations by their names."""


def at_command(name: str) -> tuple[str, str, str]:
    """A parameter and its command, as `rho`, " at " and "0 A" of `rho@0A`; the last two are empty for others."""
    match = re.fullmatch(r"(.+)@(.+?)([A-Za-z]+)", name)
    return (match[1], " at ", f"{match[2]}\N{NO-BREAK SPACE}{match[3]}") if match else (name, "", "")


def symbol_text(name: str) -> str:
    """A parameter's name with the letter of its equation, for figures: `rho@0A` as ρ at 0 A."""
    name, at, command = at_command(name)
    letters = re.match(r"[A-Za-z]*", name)
    word = letters[0] if letters else ""
    return GREEK.get(word, word) + name[len(word) :] + at + command
