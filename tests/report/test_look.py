"""Colours of figures can be told apart by eyes of all kinds, on light and dark pages, and fronts fit a screen."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import headless_browser
import numpy as np
import pytest
import study_samples
from numpy.typing import NDArray
from report_samples import comparison, fit

from mrwork import StoredRun
from mrwork.drawing import style
from mrwork.drawing.canvas import coinciding
from mrwork.report.fit.page import fit_page
from mrwork.report.study.page import study_page

Rgb = NDArray[np.float64]

CURVES = ("ink", "data", "model", "residual", "green", "orange", "violet", "brown", "plum")
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
LEAST_DISTANCE, LEAST_CONTRAST = 12.0, 3.0


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


def ciede2000(one: Rgb, other: Rgb) -> float:
    (l1, a1, b1), (l2, a2, b2) = one, other
    chroma = 0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))
    g = 0.5 * (1 - np.sqrt(chroma**7 / (chroma**7 + 25.0**7)))
    a1, a2 = (1 + g) * a1, (1 + g) * a2
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = h2 - h1
    turn = 0.0 if c1 * c2 == 0 else turn - 360 if turn > 180 else turn + 360 if turn < -180 else turn
    hue = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2))
    total = h1 + h2
    mean = total / 2 if abs(h1 - h2) <= 180 else (total + 360) / 2 if total < 360 else (total - 360) / 2
    mean = total if c1 * c2 == 0 else mean
    light, c = 0.5 * (l1 + l2), 0.5 * (c1 + c2)
    t = 1 + sum(
        weight * np.cos(np.radians(times * mean + shift))
        for weight, times, shift in ((-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.20, 4, -63))
    )
    of_light = 1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2)
    of_chroma, of_hue = 1 + 0.045 * c, 1 + 0.015 * c * t
    rotation = -2 * np.sqrt(c**7 / (c**7 + 25.0**7))
    rotation *= np.sin(np.radians(60 * np.exp(-(((mean - 275) / 25) ** 2))))
    parts = (l2 - l1) / of_light, (c2 - c1) / of_chroma, hue / of_hue
    return float(np.sqrt(sum(part**2 for part in parts) + rotation * parts[1] * parts[2]))


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        # Sharma, Wu, Dalal, Color Res. Appl. 30, 2005, 21-30, table 1: pairs 1, 7, 16 and 25.
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
        ((50.0, 2.5, 0.0), (50.0, 0.0, -2.5), 4.3065),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ],
)
def test_the_distance_is_that_of_the_literature(
    one: tuple[float, ...], other: tuple[float, ...], expected: float
) -> None:
    assert ciede2000(np.array(one), np.array(other)) == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize("mode", [0, 1], ids=["light", "dark"])
@pytest.mark.parametrize("sight", SIGHTS)
def test_curves_of_a_panel_can_be_told_apart(mode: int, sight: str) -> None:
    seen = {name: lab(SIGHTS[sight] @ linear(style.PALETTE[name][mode])) for name in CURVES}
    near = {
        (one, other): ciede2000(seen[one], seen[other])
        for one, other in combinations(CURVES, 2)
        if ciede2000(seen[one], seen[other]) < LEAST_DISTANCE
    }
    assert near == {}


@pytest.mark.parametrize("mode", [0, 1], ids=["light", "dark"])
def test_curves_and_texts_stand_out_from_the_page(mode: int) -> None:
    weights = np.array([0.2126, 0.7152, 0.0722])
    page = float(weights @ linear(style.PALETTE["page"][mode]))
    for name, least in {**dict.fromkeys(CURVES, LEAST_CONTRAST), "ink": 7.0, "faint-ink": 4.5}.items():
        own = float(weights @ linear(style.PALETTE[name][mode]))
        high, low = max(own, page), min(own, page)
        assert (high + 0.05) / (low + 0.05) >= least, name


def test_every_colour_that_is_drawn_has_a_name() -> None:
    assert set(style.HUES) <= {light for light, _ in style.PALETTE.values()}
    assert "var(--model)" in style.in_variables(f'<path style="stroke: {style.MODEL}; fill: none"/>')
    assert len(set(style.HUES)) == 6


def test_lines_that_coincide_are_said() -> None:
    line = np.array([1.0, 2.0, 3.0])
    assert coinciding({"one": line, "other": 1.001 * line, "third": 2.0 * line}) == "one and other coincide."
    assert coinciding({"one": line, "third": 2.0 * line}) == ""


@pytest.mark.parametrize("what", ["fit", "study"])
def test_the_front_fits_a_screen_and_three_of_a_telephone(
    tab: headless_browser.Browser, tmp_path: Path, what: str
) -> None:
    if what == "fit":
        tests = [comparison(f"test {number}", rng=number) for number in range(6)]
        page = fit_page(StoredRun(place=tmp_path, fit=fit(*tests)), tests)
    else:
        page = study_page(study_samples.many_motions(), study_samples.histories)
    place = tmp_path / "report.html"
    place.write_text(page)
    for width, most in ((1300, 900), (390, 3 * 844)):
        tab.open(place, width=width)
        assert tab.ask("document.querySelector('header').getBoundingClientRect().bottom") <= most
        assert tab.ask("document.documentElement.scrollWidth") <= width
        assert not tab.ask("[...document.querySelectorAll('details')].some(each => each.open)")
