"""Colours of figures can be told apart by eyes of all kinds, on light and dark pages, and fronts fit a screen."""

import csv
import io
import re
from itertools import combinations
from pathlib import Path

import headless_browser
import numpy as np
import pytest
import study_samples
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mrwork.plots import style
from mrwork.plots.canvas import coinciding, column_axes, grid_of_axes, inline_svg, small_axes, svg_bytes
from mrwork.plots.drawn import drawn_csv
from mrwork.plots.of_studies import energies, storey_profiles
from mrwork.report.study.figures import strip_of
from mrwork.report.study.page import study_page

Rgb = NDArray[np.float64]

GREYS = ("ink", "faint-ink", "data")
CURVES = (*GREYS, "model", "residual", "green", "amber", "violet", "wine")
BANDS = (*GREYS, "model", "residual", "amber", "band-edge")
"""Curves that share a panel."""
# Machado, Oliveira, Fernandes, IEEE Trans. Vis. Comput. Graph. 15, 2009, table 1: severity 1.0, of linear RGB.
SIGHTS = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}


# Of lightness and two of colour, CIE 1976.
LEAST_DISTANCE = 14.0


def linear(colour: str) -> Rgb:
    coded = np.array([int(colour[place : place + 2], 16) / 255.0 for place in (1, 3, 5)])
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def lab(rgb: Rgb) -> Rgb:
    to_xyz = np.array(
        [
            [0.4124564, 0.3575761, 0.1804375],
            [0.2126729, 0.7151522, 0.0721750],
            [0.0193339, 0.1191920, 0.9503041],
        ]
    )
    xyz = to_xyz @ np.clip(rgb, 0.0, 1.0) / np.array([0.95047, 1.0, 1.08883])
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_curves_of_a_panel_can_be_told_apart_and_stand_out_from_the_page() -> None:
    least = dict.fromkeys((*CURVES, *BANDS), 3.0) | dict.fromkeys(("faint-ink", "model", "residual"), 4.5)
    for mode in (0, 1):
        colours = {name: linear(both[mode]) for name, both in style.PALETTE.items()}
        for sight, matrix in SIGHTS.items():
            seen = {name: lab(matrix @ colours[name]) for name in least}
            pairs = {pair for panel in (CURVES, BANDS) for pair in combinations(panel, 2)}
            assert not [
                (sight, one, other)
                for one, other in pairs
                if np.linalg.norm(seen[one] - seen[other]) < LEAST_DISTANCE
            ]
        light = {name: float(np.array([0.2126, 0.7152, 0.0722]) @ each) for name, each in colours.items()}
        for name, contrast in (least | {"ink": 7.0}).items():
            low, high = sorted((light[name], light["page"]))
            assert (high + 0.05) / (low + 0.05) >= contrast, name


def test_figures_in_a_page_have_names_of_colours_and_files_have_colours() -> None:
    with style.drawn_in_style():
        figure, axes = column_axes()
        axes.plot([0, 1], color=style.MODEL)
        axes.plot([1, 0], color=style.TONES(0.3))
        axes.pcolormesh(
            [[0.0, 1.0]], cmap=LinearSegmentedColormap.from_list("map", [style.PAGE, style.MODEL])
        )
        inline, file = inline_svg(figure, identifier="f", description=""), svg_bytes(figure).decode()
    assert not re.findall(r"(?:fill|stroke): #\w+", inline)
    assert "stroke: var(--model)" in inline
    assert re.search(r"stroke: color-mix\(in srgb,var\(--model\) (59|60)\.\d%,var\(--band-edge\)\)", inline)
    assert "var(" not in file


def test_the_front_fits_a_screen_and_three_of_a_telephone(
    tab: headless_browser.Browser, tmp_path: Path
) -> None:
    place = tmp_path / "report.html"
    place.write_text(study_page(study_samples.many_motions(), study_samples.histories))
    for width, most in ((1300, 900), (390, 3 * 844)):
        tab.open(place, width=width)
        assert tab.ask("document.querySelector('header').getBoundingClientRect().bottom") <= most
        assert tab.ask("document.documentElement.scrollWidth") <= width
        assert not tab.ask("[...document.querySelectorAll('details')].some(each => each.open)")
        # The verdict on each law is read without scrolling sideways.
        verdicts = "[...document.querySelectorAll('header tbody td:nth-child(2)')]"
        assert tab.ask(f"{verdicts}.some(cell => cell.innerText.startsWith('better'))")
        assert tab.ask(f"Math.max(...{verdicts}.map(cell => cell.getBoundingClientRect().right))") <= width


def test_a_printed_page_is_open_light_and_as_wide_as_its_sheet(
    tab: headless_browser.Browser, tmp_path: Path
) -> None:
    place = tmp_path / "report.html"
    place.write_text(study_page(study_samples.many_motions(), study_samples.histories))
    # A4 without its margins.
    tab.open(place, width=680)
    dark = [{"name": "prefers-color-scheme", "value": "dark"}]
    tab.call("Emulation.setEmulatedMedia", media="print", features=dark)
    try:
        assert tab.ask("document.documentElement.scrollWidth") <= 680
        assert tab.ask("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        assert tab.ask("[...document.querySelectorAll('section')].every(each => each.clientHeight > 0)")
        # The browser repeats a foot on every sheet, and shrinks all sheets to the widest figure.
        assert tab.ask("getComputedStyle(document.querySelector('tfoot')).display") == "table-row-group"
        assert tab.ask("[...document.querySelectorAll('figure')].every(each => each.clientWidth <= 680)")
    finally:
        tab.call("Emulation.setEmulatedMedia", media="", features=[])


def read(figure: Figure) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(drawn_csv(figure))))


def test_axes_leave_the_figure_its_margins() -> None:
    for figure, axes in (small_axes(1.5), small_axes(3.0), column_axes(height=4.0)):
        (width, height), box = figure.get_size_inches(), axes.get_position()
        bottom, top = height * box.y0, height * (1.0 - box.y1)
        assert 0.2 < top < bottom < 0.6
        assert 0.5 < width * box.x0 < 0.7
    assert [small_axes(size)[0].get_size_inches()[1] for size in (1.5, 3.0)] == [1.5, 3.0]


@pytest.mark.contract
def test_numbers_of_a_figure_are_its_curves_bars_and_fills() -> None:
    results = study_samples.results()
    profile, axes = column_axes()
    storey_profiles(results, axes, motion=0, rows=[3])
    drift = read(profile)
    expected = 1e3 * results.quantities.peak_drift[3, 0, 0]
    assert [row["x"] for row in drift] == [f"{value:.6g}" for value in expected]
    assert [row["y"] for row in drift] == list(results.quantities.axes["storey"])
    assert (drift[0]["abscissa"], drift[0]["curve"]) == ("Peak drift (mm)", "Clipped-optimal")

    shares, axes = column_axes()
    energies(results, axes, motion=0, rows=range(5))
    bars = [row for row in read(shares) if row["y"] == "Lyapunov <1 A>"]
    assert [row["curve"] for row in bars] == [
        part for part in ("Dampers", "Structure", "Still moving") for _ in "ab"
    ]
    assert bars[1]["x"] == bars[2]["x"] == f"{np.sum(results.quantities.device_energy[4, 0, 0]):.6g}"

    with style.drawn_in_style():
        figure, (axes, _) = grid_of_axes(2, 2, (3.0, 3.0))
        axes.fill_between([0.0, 1.0, np.nan], [0.0, 1.0, 2.0], [2.0, 1.0 / 3.0, 2.0], label="band")
        axes.axhline(5.0, label="limit")
        axes.text(0.5, 0.5, "42")
    rows = read(figure)
    assert ("1", "0.333333") in {(row["x"], row["y"]) for row in rows if row["curve"] == "band"}
    assert {(row["x"], row["y"]) for row in rows if row["curve"] == "limit"} == {("", "5")}
    assert ("0.5", "0.5") in {(row["x"], row["y"]) for row in rows if row["curve"] == "42"}
    assert {row["panel"] for row in rows} == {"1"}
    line = np.array([1.0, 2.0, 3.0])
    assert coinciding({"one": line, "other": 1.001 * line, "third": 2.0 * line}) == "one and other coincide."


@pytest.mark.contract
def test_a_strip_of_a_command_that_switches_shows_its_switchings() -> None:
    history = study_samples.histories(3, 0)
    switching = history.numbers | {"command": (np.arange(history.time.size)[:, None] % 2) * np.ones((1, 2))}
    strip = strip_of(type(history)(time=history.time, numbers=switching))
    assert 20 <= np.count_nonzero(np.diff(switching["command"][strip, 0])) <= 40
