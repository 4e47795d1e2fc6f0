"""The page of a fit: self-contained, a section per verb that adds to it, readable in a browser."""

import json
import re
import shutil
from collections.abc import Collection
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import headless_browser
import numpy as np
import pytest
import report_samples
from blank_pictures import blank
from command_line import printed
from refusals import refusal
from report_samples import fit, prediction
from run_folders import write_fit

import mrwork as mr
from mrwork.base.remark import RemarkKind
from mrwork.identification.residual import ObservedTest
from mrwork.report import html
from mrwork.report.fit.agreement import amplitude_section
from mrwork.report.fit.figures import common_unit
from mrwork.report.fit.later import _on_coverage
from mrwork.report.fit.page import fit_page, open_run
from mrwork.report.fit.search import waterfall_panel
from mrwork.report.section import Section
from mrwork.store.codec import built, json_document
from mrwork.store.run_folder import PREDICTIONS, RunFolder
from mrwork.store.run_writer import add_to_run
from mrwork.uncertainty.bands.band import BandScore
from mrwork.uncertainty.bands.calibration_files import predictions_content, read_predictions
from mrwork.uncertainty.bands.conformal import LEVELS, LeftOutCoverage
from mrwork.uncertainty.bands.prediction import predictions_of

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


def page_of(*predictions: mr.Prediction, **changes: object) -> html.Page:
    described = replace(fit(*predictions), **changes)  # type: ignore[arg-type] # settings of several kinds by name
    return fit_page(mr.StoredRun(place=Path(), fit=described), predictions)


@pytest.fixture(scope="module")
def two_tests() -> html.Page:
    noted = (
        RemarkKind("rest", "The first 0.12 s are at rest.").remark(),
        RemarkKind("sign", "The force has been flipped", "check it").remark(),
    )
    return page_of(prediction(remarks=noted), prediction("spencer1997", synthetic=True, peak_force=400.0))


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
    assert (
        0 <= text.index("The force has been flipped; check it") < text.index("The first 0.12 s are at rest.")
    )
    told = page.text_in("section")
    for shown in ("mrwork 0.1.0", "avx2", "rig/10mm1Hz0x5A.csv", "mrwork identify rig/a.csv --seed 1"):
        assert shown in told


@pytest.mark.contract
def test_the_headline_gives_fit_nrmse_rmse_and_status() -> None:
    with blank():
        shown = page_of(prediction(), fit_percent=93.267, nrmse=0.067333, rmse_n=34.81, n_effective=212.3)
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
    assert list(rows) == [estimate.name for estimate in fit(prediction()).estimates]
    assert rows["c"] == ["c", "c", "1843.7", "6.2", "0.34", "N\N{NO-BREAK SPACE}s/m", "0", "100 000", "", ""]
    assert rows["x0"] == ["x0", "x0", "−0.000123", "0.000021", "17", "m", "−0.02", "0.02", "", ""]
    assert rows["sigma"] == ["σ", "sigma", "0.5", "–", "–", "", "0.5", "10", "", "at lower bound"]
    assert rows["n"] == ["n", "n", "2", "–", "–", "", "1", "4", "fixed", ""]


def test_synthetic_data_are_never_called_measured() -> None:
    made_up = prediction("spencer1997", synthetic=True)
    with blank():
        text = page_of(made_up)
    assert "measured" not in text
    page = Page(text)
    named = [(path, piece) for path, piece in page.texts if "spencer1997" in piece and path[-1] != "style"]
    after = {index: page.texts[index + 1][1] for index, entry in enumerate(page.texts[:-1]) if entry in named}
    for index, following in after.items():
        assert "synthetic" in page.texts[index][1] + following


def test_an_unfinished_fit_says_so_in_a_banner() -> None:
    banner, reason = 'role="alert"', "a false minimum is suspected"
    with blank():
        assert banner not in page_of(prediction())
        assert "was interrupted" in page_of(prediction(), status="interrupted").split(banner)[1][:300]
        text = page_of(prediction(), status="not_converged", status_reason=reason).split(banner)[1][:300]
    assert f"before it converged: {reason}. The" in text


def test_names_from_files_cannot_write_markup() -> None:
    hostile = '<script>alert("1")</script>&amp;'
    found = RemarkKind("x", "{text}").remark(text=hostile)
    text = page_of(prediction(hostile, remarks=(found,)), stop_reason=hostile)
    page = Page(text)
    assert "script" not in {tag for tag, _ in page.elements}
    assert text.count("alert(&#34;1&#34;)") + text.count("alert(&quot;1&quot;)") > 5


@pytest.mark.contract
def test_one_unit_serves_all_tests_of_a_report() -> None:
    small, large = prediction(peak_force=900.0), prediction("strong", peak_force=20_000.0)
    assert common_unit([small]) == "N"
    assert common_unit([small, large]) == "kN"
    text = page_of(small, large)
    assert "Force (kN)" in text
    assert "Force (N)" not in text


READING = ["--every", "5"]
LEFT_OUT = ["synthetic:spencer1997_slow", "synthetic:spencer1997_fast"]
TESTS, AMPLITUDES = "agreement-with-the-fitted-tests", "errors-by-amplitude"
OWN_SECTIONS = [
    *(TESTS, "parameters", AMPLITUDES, "residuals", "search", "not-in-this-report-yet", "provenance")
]
# Text below this is hard to read on a telephone [px].
READABLE = 8.5


def run_verb(*arguments: str | Path) -> None:
    printed(*arguments, "--json", "--quiet")


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run as `identify` leaves it."""
    place = tmp_path_factory.mktemp("page") / "plain"
    run_verb("identify", "synthetic:spencer1997", "--model", "viscous_dahl", *READING, "--out", place)
    return place


@pytest.fixture(scope="module")
def whole(plain: Path) -> Path:
    """The same with all that later verbs add."""
    place = plain.with_name("whole")
    shutil.copytree(plain, place)
    # The last verb draws the page anew.
    with blank():
        run_verb("intervals", place)
        run_verb("intervals", place, "--posterior", "--steps", "60", "--walkers", "16")
        run_verb("calibrate", place, *LEFT_OUT, *READING)
    run_verb("plan", place, "--amplitudes", "0.005,0.02", "--frequencies", "1,3")
    return place


def anchors(place: Path) -> list[str]:
    page = Page((place / "report.html").read_text())
    return [
        attributes["id"] or "" for tag, attributes in page.elements if tag == "section" and "id" in attributes
    ]


def test_every_verb_adds_its_section_and_a_page_written_again_is_the_same(plain: Path, whole: Path) -> None:
    assert anchors(plain) == OWN_SECTIONS
    text = (plain / "report.html").read_text()
    for command in ("mrwork intervals RUN", "mrwork intervals RUN --posterior", "mrwork calibrate RUN TESTS"):
        assert f"<code>{command}</code>" in text
    added = ["prediction-bands", "profile-likelihood", "posterior", AMPLITUDES, "residuals", "next-test"]
    assert anchors(whole) == [TESTS, "parameters", *added, *OWN_SECTIONS[-3:]]
    page = (whole / "report.html").read_text()
    profiles = mr.load(whole).profiles
    level = f"{100.0 * profiles.level:g}\N{NO-BREAK SPACE}%"
    assert f"{level} intervals of {len(profiles.profiles)} parameters" in page
    assert_links_lead_somewhere(page, [f"data/{path.name}" for path in (whole / "data").iterdir()])
    assert len(page.encode()) < 2_000_000
    heard: list[mr.Progress] = []
    assert fit_page(*open_run(whole), on_progress=heard.append) == page
    assert [each.numbers["done"] for each in heard] == list(range(int(heard[0].numbers["total"])))


def test_coverage_is_printed_beside_the_band_as_it_was_measured(whole: Path) -> None:
    page = Page((whole / "report.html").read_text())
    shown = page.text_in("figcaption").replace("\N{NO-BREAK SPACE}", " ")
    rows = json.loads((whole / "calibration.json").read_text())["coverage"]
    for row in (row for row in rows if row["level"] == 0.9):
        assert f"Inside the 90 % band: {100 * row['samples']['coverage']:.1f} % of the samples" in shown


def worse(number: int) -> mr.Prediction:
    """A test whose model misses more with its number."""
    made = prediction(f"test{number}", n_time=400, remarks=(DRIFT,))
    model = (1.0 - 0.1 * number) * made.model_force
    return replace(made, model_force=model)


DRIFT = RemarkKind("drift", "the force drifts by 3 %", "cool it").remark()


@pytest.mark.contract
def test_of_many_tests_the_best_the_median_and_the_worst_are_drawn_in_full() -> None:
    # Best fit first, so that the second to last is not the worst.
    shown = [worse(number) for number in (3, 0, 4, 1, 2)]
    run = mr.StoredRun(place=Path(), fit=fit(*shown))
    heard: list[mr.Progress] = []
    with blank():
        page = Page(fit_page(run, shown, on_progress=heard.append))
        every = Page(fit_page(run, shown, every_test=True))
    headings = page.text_in("h3")
    for expected in ("Best fit: test0", "Median fit: test2", "Worst fit: test4"):
        assert expected in headings
    assert "test3" not in headings
    identifiers = set(page.values("id"))
    assert {f"o{number}-title" for number in range(1, 6)} <= identifiers
    assert {"t2-record-title", "t3-record-title", "t5-record-title", TESTS} <= identifiers
    assert {target[1:] for target in page.values("href") if target.startswith("#")} <= identifiers
    percents = [each.fit_percent for each in shown]
    assert f"5 tests: fit median {np.median(percents):.2f} %" in page.text_in("summary").replace("\xa0", " ")
    assert page.text_in("ul").count("warning in all 5 tests: the force drifts by 3") == 1
    assert [each.numbers["done"] for each in heard] == list(range(int(heard[0].numbers["total"])))
    assert {f"t{number}-record-title" for number in range(1, 6)} <= set(every.values("id"))


def test_a_fit_without_local_minimisations_has_no_waterfall() -> None:
    described = fit(prediction())
    assert waterfall_panel(described) is None
    one = replace(described, trace=replace(described.trace, ends=(0.1, 0.1, 0.4)))
    found = waterfall_panel(one)
    assert found is not None
    assert "2 of 3 local minimisations ended at the least misfit" in found.note


@pytest.mark.contract
def test_predictions_come_back_as_they_were_but_for_rounding(tmp_path: Path) -> None:
    made = prediction(n_time=400)
    switched = replace(made, test=replace(made.test, name="switched", current=np.arange(400) % 2.0))
    content = predictions_content([made, switched])
    place = write_fit(tmp_path / "run", fit(made))
    add_to_run(place, {PREDICTIONS: content})
    read, varied = read_predictions(RunFolder.open(place))
    np.testing.assert_array_equal(varied.test.current, switched.test.current)
    assert (read.test.name, read.test.dt, read.test.current) == (made.test.name, made.test.dt, 0.5)
    np.testing.assert_allclose(read.model_force, made.model_force, rtol=1e-6, atol=1e-4)
    np.testing.assert_allclose(read.test.force, made.test.force, rtol=1e-6)
    (place / PREDICTIONS).write_bytes(b"PK nothing")
    refusal(read_predictions, RunFolder.open(place), match="is not as mrwork has written it")


_FIGURES = """
[...document.querySelectorAll('figure svg')].map(e => e.getBoundingClientRect()).map(r => [r.width, r.height])
"""
# The size on screen of every piece of text, SVG included: its font size times the scale of its drawing.
_TEXT = """
[...document.querySelectorAll('body *')].filter(e => [...e.childNodes].some(n => n.nodeType === 3 && n.data.trim()))
  .filter(e => e.tagName !== 'title' && e.tagName !== 'STYLE')
  .map(e => {
    const size = parseFloat(getComputedStyle(e).fontSize)
    const matrix = e.getScreenCTM ? e.getScreenCTM() : null
    return [matrix ? size * Math.hypot(matrix.a, matrix.b) : size, e.textContent.trim().slice(0, 30)]
  })
  .filter(pair => pair[0] < %g)
"""
_WIDE = "[document.documentElement.scrollWidth, window.innerWidth]"


def test_a_browser_shows_all_figures_and_on_a_telephone_all_can_be_read(
    tab: headless_browser.Browser, whole: Path
) -> None:
    page = Page((whole / "report.html").read_text())
    for width in (1100, 390):
        tab.open(whole / "report.html", width=width)
        assert tab.complaints == []
        sizes = tab.ask(_FIGURES)
        assert len(sizes) == sum(tag == "svg" for tag, _ in page.elements)
        assert all(across > 100 and high > 60 for across, high in sizes)
    across, window = tab.ask(_WIDE)
    assert across <= window == 390
    assert tab.ask(_TEXT % READABLE) == []


@pytest.mark.contract
def test_the_forces_of_a_result_are_simulated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[str] = []
    predicted = ObservedTest.predict_force

    def counted(observed: ObservedTest, *arguments: Any, **settings: Any) -> Any:
        runs.append(observed.test.name)
        return predicted(observed, *arguments, **settings)

    monkeypatch.setattr(ObservedTest, "predict_force", counted)
    tests = [mr.records.cut(mr.synthetic_test(name), every=8) for name in ("spencer1997", "spencer1997_fast")]
    found = mr.identify("bingham", tests)
    shown = predictions_of(found, tests)
    assert runs == [test.name for test in tests]
    # Read from its file, a fit has no forces: they are simulated then, to the same bits.
    again = built(mr.Fit, json.loads(json_document(found.as_dict())))
    assert again.forces == ()
    for one, other in zip(shown, predictions_of(again, tests), strict=True):
        np.testing.assert_array_equal(one.model_force, other.model_force)


def with_error(amplitude: float, error: np.ndarray | float) -> mr.Prediction:
    """A test of this amplitude [m] whose model is off by this force [N]."""
    found = report_samples.prediction(f"{1e3 * amplitude:g} mm", amplitude=amplitude)
    return replace(found, model_force=found.test.force - error)


def rows(section: Section) -> dict[str, dict[str, str]]:
    """Cells of the table by column, by the first cell of their row."""
    (group,) = section.groups
    assert group.table is not None
    return {row[0]: dict(zip(group.table.columns, row, strict=True)) for row in group.table.rows}


@pytest.mark.contract
def test_each_class_of_amplitudes_has_its_own_error() -> None:
    section = amplitude_section([with_error(0.038, 10.0), with_error(0.002, 40.0), with_error(0.0021, 40.0)])
    found = rows(section)
    assert list(found) == ["2 to 2.1 mm", "38 mm", "all"]
    assert found["38 mm"]["RMSE"] == "10.0"
    assert found["2 to 2.1 mm"]["RMSE"] == "40.0"
    # Seven and a half cycles from the first reversal on, of each test.
    assert [each["half cycles"] for each in found.values()] == ["30", "15", "45"]
    assert float(found["all"]["RMSE"]) == pytest.approx(np.sqrt((10.0**2 + 2 * 40.0**2) / 3), abs=0.06)
    assert "in those of 2 to 2.1 mm" in section.summary
    (group,) = amplitude_section([with_error(0.038, 10.0), with_error(0.002, 40.0)]).groups
    (sentence,) = group.prose
    assert "In half cycles of 2 mm the error over the force is 4 times that in those of 38 mm." in sentence
    (group,) = amplitude_section([with_error(0.038, 10.0), with_error(0.002, 15.0)]).groups
    assert group.prose == ()


@pytest.mark.contract
def test_samples_that_are_not_compared_do_not_count() -> None:
    found = with_error(0.01, 10.0)
    error = np.full(found.test.n_time, 10.0)
    error[500:700] = 1e6
    test = replace(found.test, uncompared=((500, 700),))
    (row,) = rows(amplitude_section([replace(found, test=test, model_force=test.force - error)])).values()
    assert row["RMSE"] == "10.0"


@pytest.mark.contract
def test_the_verdict_on_bands_is_that_of_their_coverage() -> None:
    def verdict(*shares: float) -> str:
        score = BandScore(coverage=0.0, width=1.0, interval_score=1.0)
        return _on_coverage(
            [
                {
                    level: LeftOutCoverage(
                        test="one", level=level, samples=replace(score, coverage=own), cycles_inside=1.0
                    )
                    for level, own in zip(LEVELS, (share, 0.9, 0.95), strict=True)
                }
                for share in shares
            ]
        )

    few = verdict(0.91, 0.022, 0.85)
    assert "nominal coverage" in few
    assert "3 tests are too few to tell" in few
    assert "have about" not in few
    assert "have about their nominal coverage" in verdict(*[0.5] * 5)
    assert "50 % bands are too narrow" in verdict(*[0.1] * 5)
    assert "50 % bands are wider than necessary" in verdict(*[0.9] * 5)
