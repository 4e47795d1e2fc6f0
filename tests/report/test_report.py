"""The report: one self-contained page with all results of a fit."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest
from blank_pictures import blank
from report_samples import comparison, fit

from mrwork import StoredRun
from mrwork.drawing import of_tests
from mrwork.drawing.of_tests import Comparison
from mrwork.records import Finding
from mrwork.report import html
from mrwork.report.fit.page import fit_page

VOID = {"meta", "br", "wbr", "link", "img", "hr"}


class Page(HTMLParser):
    """A strict reading of a page: its elements, their attributes and texts, and what is wrong with it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[tuple[str, ...], str]] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == [], f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"</{tag}> closes something else at {self.getpos()}"

    def handle_data(self, data: str) -> None:
        if data.strip():
            self.texts.append((tuple(self.open), data.strip()))

    def values(self, attribute: str) -> list[str]:
        return [
            value or ""
            for _, attributes in self.elements
            for name, value in attributes.items()
            if name == attribute
        ]

    def text_in(self, tag: str) -> str:
        return " ".join(text for path, text in self.texts if tag in path)


def report(*comparisons: Comparison, **changes: object) -> html.Page:
    described = replace(fit(*comparisons), **changes)  # type: ignore[arg-type] # settings of several kinds by name
    return fit_page(StoredRun(place=Path(), fit=described), comparisons)


@pytest.fixture(scope="module")
def two_tests() -> html.Page:
    noted = (
        Finding(code="rest", severity="note", message="The first 0.12 s are at rest."),
        Finding(code="sign", severity="warning", message="The force has been flipped."),
    )
    return report(comparison(findings=noted), comparison("spencer1997", synthetic=True, peak_force=400.0))


def assert_links_lead_somewhere(text: str, files: Collection[str]) -> None:
    """The page is well formed, asks for nothing from anywhere else, and leads to its own places and these files."""
    page = Page(text)
    assert not {"script", "link", "img", "iframe", "object", "base"} & {tag for tag, _ in page.elements}
    identifiers = page.values("id")
    assert len(identifiers) == len(set(identifiers))
    linked = [each for each in page.values("href") + page.values("xlink:href") if each[:5] != "data:"]
    beside = {target for target in linked if target.startswith("data/")}
    assert beside <= set(files)
    targets = {target[1:] for target in linked if target not in beside}
    drawn = set(re.findall(r"url\(([^)]*)\)", text))
    assert all(target.startswith(("#", "data:font/woff;")) for target in drawn)
    targets |= {target[1:] for target in drawn if target.startswith("#")} | {*page.values("aria-labelledby")}
    assert targets <= set(identifiers)
    assert "@import" not in text


def test_the_page_can_be_read_aloud_and_needs_nothing_from_elsewhere(two_tests: html.Page) -> None:
    assert_links_lead_somewhere(two_tests, two_tests.files)
    page = Page(two_tests)
    assert dict(page.elements)["html"]["lang"] == "en"
    levels = [int(tag[1]) for tag, _ in page.elements if re.fullmatch(r"h[1-6]", tag)]
    assert levels.count(1) == levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    drawings = [attributes for tag, attributes in page.elements if tag == "svg"]
    described = [text for path, text in page.texts if path[-2:] == ("svg", "title")]
    assert len(drawings) == len(described) == 2 * 4 + 3 + 1 + 2
    assert all(attributes["role"] == "img" for attributes in drawings)
    text = page.text_in("ul")
    assert 0 <= text.index("The force has been flipped.") < text.index("The first 0.12 s are at rest.")
    told = page.text_in("section")
    for shown in ("mrwork 0.1.0", "avx2", "rig/10mm1Hz0x5A.csv", "mrwork identify rig/a.csv --seed 1"):
        assert shown in told


@pytest.mark.contract
def test_the_headline_gives_fit_nrmse_rmse_and_status() -> None:
    with blank():
        shown = report(comparison(), fit_percent=93.267, nrmse=0.067333, rmse_n=34.81, n_effective=212.3)
    text = Page(shown).text_in("header")
    for expected in ("93.3", "0.0673", "34.8", "Converged", "after 14 refinement steps", "10mm1Hz0x5A"):
        assert expected in text
    assert "Standard error, 212 effective samples" in shown


@pytest.mark.contract
def test_every_parameter_stands_in_the_table_with_its_error_bounds_and_verdict(two_tests: html.Page) -> None:
    table = two_tests[two_tests.index('aria-label="Parameters"') :]
    table = table[table.index("<tbody>") : table.index("</tbody>")]
    rows = {}
    for row in re.findall(r"<tr>.*?</tr>", table):
        cells = [re.sub(r"<[^>]+>", "", cell) for cell in re.findall(r"<t[dh].*?</t[dh]>", row)]
        cells[:1] = cells[0].split()
        rows[cells[1]] = [cell.replace("\N{NARROW NO-BREAK SPACE}", " ") for cell in cells]
    assert list(rows) == [estimate.name for estimate in fit(comparison()).estimates]
    assert rows["c"] == ["c", "c", "1843.7", "6.2", "0.34", "N\N{NO-BREAK SPACE}s/m", "0", "100 000", "", ""]
    assert rows["x0"] == ["x0", "x0", "−0.000123", "0.000021", "17", "m", "−0.02", "0.02", "", ""]
    assert rows["sigma"] == ["σ", "sigma", "0.5", "–", "–", "", "0.5", "10", "", "at lower bound"]
    assert rows["n"] == ["n", "n", "2", "–", "–", "", "1", "4", "fixed", ""]


def test_synthetic_data_are_never_called_measured() -> None:
    made_up = comparison("spencer1997", synthetic=True)
    with blank():
        text = report(made_up)
    assert "measured" not in text
    page = Page(text)
    named = [(path, piece) for path, piece in page.texts if "spencer1997" in piece and path[-1] != "style"]
    after = {index: page.texts[index + 1][1] for index, entry in enumerate(page.texts[:-1]) if entry in named}
    for index, following in after.items():
        assert "synthetic" in page.texts[index][1] + following


def test_an_unfinished_fit_says_so_in_a_banner() -> None:
    banner, reason = 'role="alert"', "a false minimum is suspected"
    with blank():
        assert banner not in report(comparison())
        assert "was interrupted" in report(comparison(), status="interrupted").split(banner)[1][:300]
        text = report(comparison(), status="not_converged", status_reason=reason).split(banner)[1][:300]
    assert f"before it converged: {reason}. The" in text


def test_names_from_files_cannot_write_markup() -> None:
    hostile = '<script>alert("1")</script>&amp;'
    found = Finding(code="x", severity="note", message=hostile)
    text = report(comparison(hostile, findings=(found,)), stop_reason=hostile)
    page = Page(text)
    assert "script" not in {tag for tag, _ in page.elements}
    assert text.count("alert(&#34;1&#34;)") + text.count("alert(&quot;1&quot;)") > 5


@pytest.mark.contract
def test_one_unit_serves_all_tests_of_a_report() -> None:
    small, large = comparison(peak_force=900.0), comparison("strong", peak_force=20_000.0)
    assert of_tests.common_force_unit([small]).symbol == "N"
    assert of_tests.common_force_unit([small, large]).symbol == "kN"
    text = report(small, large)
    assert "Force (kN)" in text
    assert "Force (N)" not in text
