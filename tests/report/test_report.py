"""The report: one self-contained page with all results of a fit."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import measured_data
import numpy as np
import pytest
from report_samples import comparison, fit, quality
from sentences import Refused

from mrwork import StoredRun
from mrwork.drawing import of_tests
from mrwork.drawing.of_tests import Comparison
from mrwork.records import DamperTest, Finding
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


def test_the_page_asks_for_nothing_from_anywhere_else(two_tests: html.Page) -> None:
    page = Page(two_tests)
    assert not {"script", "link", "img", "iframe", "object", "base"} & {tag for tag, _ in page.elements}
    linked = page.values("href") + page.values("xlink:href") + page.values("src")
    assert linked
    assert all(target.startswith(("#", "data/")) for target in linked)
    assert all(
        target.startswith(("#", "data:font/woff;")) for target in re.findall(r"url\(([^)]*)\)", two_tests)
    )
    assert "@import" not in two_tests


def test_the_page_is_well_formed_and_its_links_lead_somewhere(two_tests: html.Page) -> None:
    page = Page(two_tests)
    identifiers = page.values("id")
    assert len(identifiers) == len(set(identifiers))
    links = {*page.values("href"), *page.values("xlink:href")}
    beside = {target for target in links if target.startswith("data/")}
    assert beside == set(two_tests.files)
    targets = {target[1:] for target in links - beside}
    targets |= set(re.findall(r"url\(#([^)]*)\)", two_tests))
    targets |= set(page.values("aria-labelledby"))
    assert targets <= set(identifiers)


def test_the_page_can_be_read_aloud(two_tests: html.Page) -> None:
    page = Page(two_tests)
    assert dict(page.elements)["html"]["lang"] == "en"
    assert "Normalised Bouc-Wen" in next(text for path, text in page.texts if path[-1] == "title")
    levels = [int(tag[1]) for tag, _ in page.elements if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    drawings = [attributes for tag, attributes in page.elements if tag == "svg"]
    described = [text for path, text in page.texts if path[-2:] == ("svg", "title")]
    assert len(drawings) == len(described) == 2 * 4 + 3 + 1 + 2
    assert all(attributes["role"] == "img" for attributes in drawings)
    assert sum("10mm1Hz0x5A" in text and "fit 9" in text for text in described) == 5
    assert all("scope" in attributes for tag, attributes in page.elements if tag == "th")


def test_the_headline_gives_fit_nrmse_rmse_and_status() -> None:
    text = Page(report(comparison(), fit_percent=93.267, nrmse=0.067333, rmse_n=34.81)).text_in("header")
    for shown in ("93.3", "0.0673", "34.8", "Converged", "after 14 refinement steps", "10mm1Hz0x5A"):
        assert shown in text


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


def test_the_page_says_how_many_samples_the_standard_errors_count() -> None:
    tested = comparison()
    described = fit(tested)
    counted = report(tested, n_effective=212.3)
    assert "Standard error, 212 effective samples" in counted
    assert "residuals count as 212 effective samples" in counted
    nothing = tuple(replace(estimate, standard_error=None) for estimate in described.estimates)
    assert "No standard errors" in report(tested, estimates=nothing)


def test_findings_are_shown_with_warnings_first(two_tests: html.Page) -> None:
    text = Page(two_tests).text_in("ul")
    assert 0 <= text.index("The force has been flipped.") < text.index("The first 0.12 s are at rest.")
    assert "the checks of 2 records found 1 warning, 1 note." in two_tests


def test_provenance_is_complete(two_tests: html.Page) -> None:
    text = Page(two_tests).text_in("section")
    for shown in (
        "mrwork 0.1.0",
        "avx2",
        "rig/10mm1Hz0x5A.csv",
        "mrwork identify rig/a.csv --seed 1",
        "2025-01-31",
    ):
        assert shown in text
    assert "<code>0123456789ab</code>" in two_tests


def test_synthetic_data_are_never_called_measured() -> None:
    made_up = comparison("spencer1997", synthetic=True)
    text = report(made_up)
    assert "measured" not in text
    page = Page(text)
    named = [(path, piece) for path, piece in page.texts if "spencer1997" in piece and path[-1] != "style"]
    after = {index: page.texts[index + 1][1] for index, entry in enumerate(page.texts[:-1]) if entry in named}
    for index, following in after.items():
        assert "synthetic" in page.texts[index][1] + following


def test_an_unfinished_fit_says_so_in_a_banner() -> None:
    banner = 'role="alert"'
    assert banner not in report(comparison())
    assert "was interrupted" in report(comparison(), status="interrupted").split(banner)[1][:300]
    assert "before it converged. The" in report(comparison(), status="not_converged").split(banner)[1][:300]
    reason = "a false minimum is suspected"
    text = report(comparison(), status="not_converged", status_reason=reason).split(banner)[1][:300]
    assert f"before it converged: {reason}. The" in text


def test_warnings_of_a_fit_stand_above_its_figures() -> None:
    warned = replace(fit(comparison()), warnings=("the commands differ",))
    text = fit_page(StoredRun(place=Path(), fit=warned), [comparison()])
    assert text.index("The commands differ") < text.index('class="headline"')
    assert "warning: the commands differ" in repr(warned)
    assert warned.as_dict()["warnings"] == ("the commands differ",)


def test_names_from_files_cannot_write_markup() -> None:
    hostile = '<script>alert("1")</script>&amp;'
    found = Finding(code="x", severity="note", message=hostile)
    text = report(comparison(hostile, findings=(found,)), stop_reason=hostile)
    page = Page(text)
    assert "script" not in {tag for tag, _ in page.elements}
    assert text.count("alert(&#34;1&#34;)") + text.count("alert(&quot;1&quot;)") > 5


def test_a_long_record_makes_a_small_page() -> None:
    assert len(report(comparison(n_time=11_000, duration=44.0)).encode()) < 700_000


def test_the_same_fit_makes_the_same_page() -> None:
    assert report(comparison()) == report(comparison())


def test_a_model_force_of_another_length_is_refused(refused: Refused) -> None:
    tested = comparison()
    refused(replace, tested, model_force=np.zeros(7))


def test_one_unit_serves_all_tests_of_a_report() -> None:
    small, large = comparison(peak_force=900.0), comparison("strong", peak_force=20_000.0)
    assert of_tests.common_force_unit([small]).symbol == "N"
    assert of_tests.common_force_unit([small, large]).symbol == "kN"
    text = report(small, large)
    assert "Force (kN)" in text
    assert "Force (N)" not in text


def test_a_measured_record_is_reported(two_tests: html.Page) -> None:
    folder = measured_data.DATA / "dampers" / "utfsm"
    if not folder.is_dir():
        pytest.skip(f"no measured data: {folder} is absent, set MRWORK_DATA")
    table = np.genfromtxt(folder / "10mm1Hz0x5A.csv", delimiter=",", names=True)
    displacement, velocity, force = table["displacement_m"], table["velocity_mps"], table["force_n"]
    basis = np.column_stack([np.tanh(80 * velocity + 60 * displacement), velocity, displacement])
    model = basis @ np.linalg.lstsq(basis, force, rcond=None)[0]
    test = DamperTest(
        name="10mm1Hz0x5A",
        path="10mm1Hz0x5A.csv",
        sha256="0" * 64,
        dt=0.001,
        start_time=0.0,
        displacement=displacement,
        velocity=velocity,
        force=force,
        velocity_source="measured",
    )
    text = report(Comparison(test=test, model_force=model, quality=quality(test, model)))
    # The command moved at 1 Hz for eleven seconds.
    assert "Cycles 4 to 6" in text
    assert len(text.encode()) < 600_000


def test_a_repaired_test_shows_its_loops_before_and_after() -> None:
    whole = comparison()
    raised = replace(whole.test, force=whole.test.force + 300.0)
    repaired = replace(whole, test=replace(whole.test, original=raised))
    title = "Before and after repair"
    assert title in report(repaired)
    assert title not in report(whole)
