"""Figures look the same on every machine: one font, shipped with matplotlib, for measuring and drawing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib import font_manager
from report_samples import comparison

from mrwork.report import figures, font, style
from mrwork.report.svg import inline_svg, svg_bytes

_DRAW = """
import sys, hashlib
from report_samples import comparison
from mrwork.report import figures
from mrwork.report.svg import inline_svg, svg_bytes
figure = figures.force_history(comparison())
print(hashlib.sha256(svg_bytes(figure) + inline_svg(figure, identifier="f", description="").encode()).hexdigest())
"""


@pytest.mark.parametrize("weight", [400, 700])
def test_the_family_is_the_file_that_matplotlib_ships(weight: int) -> None:
    font.register()
    found = font_manager.findfont(font_manager.FontProperties(family=font.FAMILY, weight=weight))
    assert Path(found).samefile(font.path_of(weight))


def test_no_other_family_is_drawn() -> None:
    text = inline_svg(figures.force_history(comparison()), identifier="f", description="")
    assert font.FAMILY in text
    assert "DejaVu" not in text
    assert "sans-serif" not in text


def test_the_page_brings_the_font_along() -> None:
    faces = font.font_faces()
    assert faces.count("@font-face") == 2
    assert faces.count("data:font/woff;base64,") == 2
    assert len(faces) < 100_000


def test_fonts_of_the_system_change_no_figure(tmp_path: Path) -> None:
    """A system with another DejaVu Sans, preferred by its list of fonts, and one without any."""
    drawn = set()
    for number, extra in enumerate(("", "font_manager.fontManager.ttflist.clear();")):
        prepare = f"from matplotlib import font_manager; {extra}\n"
        environment = os.environ | {
            "MPLCONFIGDIR": str(tmp_path / str(number)),
            "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[1] / "samples"), *sys.path]),
        }
        done = subprocess.run(
            [sys.executable, "-c", prepare + _DRAW],
            capture_output=True,
            text=True,
            env=environment,
            check=True,
        )
        drawn.add(done.stdout)
    with style.drawn_in_style():
        figure = figures.force_history(comparison())
    assert svg_bytes(figure)
    assert len(drawn) == 1
