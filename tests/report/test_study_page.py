"""The page of a study: its contents, and its display in a browser without errors."""

import re
from dataclasses import replace
from pathlib import Path

import headless_browser
import numpy as np
import pytest
import study_samples
from blank_pictures import blank

import mrwork as mr
from mrwork.plots.samples import envelope
from mrwork.report.section import Lead
from mrwork.report.study.figures import fragilities_of_page
from mrwork.report.study.front import study_lead
from mrwork.report.study.page import study_page
from mrwork.study import StudyResults, compared
from mrwork.study.study import Row
from mrwork.study.tables import MOST_DRAWN, MOST_LISTED, shown_rows, value_table


def page_of(**changes: object) -> str:
    results = study_samples.with_runs(study_samples.results(), **changes)  # type: ignore[arg-type] # any field
    return study_page(results, study_samples.histories)


def text_of(**changes: object) -> str:
    """The page with blank pictures."""
    with blank():
        return page_of(**changes)


@pytest.fixture(scope="module")
def page() -> str:
    return page_of()


def test_every_row_motion_and_warning_stands_on_the_page(page: str) -> None:
    for row in study_samples.ROWS:
        assert row.label.replace("<", "&lt;").replace(">", "&gt;") in page
    for motion in study_samples.MOTIONS:
        assert motion.name in page
    assert "of the largest energy, by up to 3.0e-04" in page
    assert page.count("half the step tells which") == 1
    whole = study_samples.runs_by_place(study_samples.results())
    calm = {key: run for key, run in whole.items() if key != (3, 1)}
    assert "half the step tells which" not in text_of(runs=calm)
    assert "<1 A>" not in page
    assert not re.search(r'(src|href)="(https?:)?//', page)
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names))
    still = {key: {**run, "input_energy": 0.0} if key[0] == 2 else run for key, run in whole.items()}
    assert "nan" not in text_of(runs=still).split("Balance of energy")[1].split("</table>")[0].lower()
    assert '<th scope="row" class="name">El Centro</th>' in page


@pytest.mark.contract
def test_the_best_law_of_each_column_is_bold_and_the_reference_never_is() -> None:
    results = study_samples.results()
    table = value_table(results, (0,), range(len(results.rows)))
    # Each row of the samples swings less than those before it; i = 0 and isolation are the only ones of their kind.
    assert {table.rows[row][0] for row, _ in table.strong} == {"Lyapunov <1 A>"}
    assert {column for _, column in table.strong} == set(range(1, 7))


@pytest.mark.contract
def test_a_building_without_dampers_shows_no_force() -> None:
    results = study_samples.results()
    table = value_table(results, (0,), range(len(results.rows)))
    assert table.rows[0][table.columns.index("Force")] == "–"
    assert table.rows[1][table.columns.index("Force")] != "–"
    assert table.rows[4][table.columns.index("Switchings")] == "2.00"
    # Isolators are no dampers with a command.
    assert table.rows[2][table.columns.index("Force")] == "–"


@pytest.mark.contract
def test_a_check_of_the_step_has_its_table_and_counts_no_switchings() -> None:
    results = study_samples.results()
    runs = study_samples.runs_by_place(results)
    assert 'id="half-the-step"' not in text_of()
    for number, told in (("rms_current", "0.25 of its value, for Lyapunov"), ("switching_rate", "0 of its")):
        moved = {**runs[4, 1], number: 1.25 * runs[4, 1][number]}
        checked = text_of(halved={**runs, (4, 1): moved})
        assert f"no criterion by more than {told}" in checked


@pytest.mark.contract
def test_records_at_several_levels_have_a_section_and_a_row_each() -> None:
    results = study_samples.incremental()
    limited = replace(results, limit={"peak_drift": 0.02})
    with blank():
        text = study_page(limited, study_samples.histories)
    # The front states the medians of the leading law and of its references.
    front = text.partition("<details")[0]
    stated = " ".join(front.split()).partition("Median PGA at which the peak drift reaches 0.02 m: ")[2]
    assert re.match(r"(above )?0\.\d+ g( \(0\.\d+ to [0-9.∞]+\))? with ", stated)
    assert "the PGA at which the peak drift reaches 0.02 m, of 5 records at 4 levels" in text
    assert "4, PGA 0.100 to 0.400 g" in text
    assert "record 0, 0.1 g</" not in text.partition('id="ground-motions"')[2]
    low = replace(results, building=replace(results.building, heights=()))
    for without in (low, replace(study_samples.results(), limit={"peak_drift": 0.02})):
        assert fragilities_of_page(without) is None


@pytest.mark.contract
def test_thinning_keeps_the_peaks() -> None:
    rng = np.random.default_rng(1)
    signal = rng.normal(size=10_007)
    time = np.arange(10_007.0)
    thin_time, thin = envelope(time, signal, 300)
    assert thin.max() == signal.max()
    assert thin.min() == signal.min()
    assert (np.diff(thin_time) >= 0.0).all()
    assert len(thin) < 1000


def test_the_page_fits_its_window_without_complaint(
    tab: headless_browser.Browser, tmp_path: Path, page: str
) -> None:
    path = tmp_path / "report.html"
    path.write_text(page)
    for width in (1100, 390):
        tab.open(path, width=width)
        assert tab.ask("document.documentElement.scrollWidth") <= width
    assert tab.complaints == []


def many_laws(count: int) -> StudyResults:
    """The study with so many control laws, each of which lowers the response a little more than the one before."""
    laws = tuple(Row(label=f"law {number}", kind="controller") for number in range(count))
    rows = (*study_samples.ROWS[:3], *laws)
    few = study_samples.results()
    runs = {(row, 0): study_samples.runs_by_place(few)[row, 0] for row in range(3)}
    runs |= {(row, 0): study_samples.run(0.04 - 0.02 * (row - 3) / count, 2) for row in range(3, len(rows))}
    return study_samples.with_runs(few, runs, rows=rows, motions=[*few.motions][:1])


def text_of_many(results: StudyResults) -> str:
    with blank():
        return study_page(results, lambda row, motion: study_samples.history(0.03, 0 if row == 0 else 2))


@pytest.mark.contract
def test_of_many_laws_the_page_shows_the_best_and_says_so() -> None:
    page = text_of_many(many_laws(100))
    assert f"Tables show {MOST_LISTED} of 103 arrangements" in page
    assert f"figures show {MOST_DRAWN} of 103" in page
    assert f"histories are drawn of {MOST_DRAWN} of 103" in page
    shown = {int(number) for number in re.findall(r'class="name">law (\d+)<', page)}
    # The sample has two references and isolation, whose rank is its own.
    assert shown == set(range(100 - (MOST_LISTED - 3), 100))
    # The loops of the leading law, and of the best of the passive dampers.
    assert page.count("Current of damper 1 under") == 2
    assert "94 more laws below, in grey above." in page
    # What is counted is counted over all.
    assert "Worse control laws, of 100" in page
    assert "lowest score of 100 control laws" in page


@pytest.mark.contract
@pytest.mark.parametrize("count", [2, 10, 100])
def test_passive_on_stays_in_the_table_beside_an_optimal_passive_that_is_the_same(count: int) -> None:
    """Also where laws leave no room for passive-off."""
    few = study_samples.results()
    laws = [Row(label=f"law {number}", kind="controller") for number in range(count)]
    on, best = Row(label="on", kind="passive"), Row(label="Optimal passive, 100 %", kind="best_passive")
    rows = (*study_samples.ROWS[:2], *laws, on, best)
    runs = {(row, 0): study_samples.run(0.02, 2) for row in range(len(rows))}
    runs |= {(row, 0): study_samples.run(0.05, 2 * row) for row in range(2)}
    results = study_samples.with_runs(few, runs, rows=rows, motions=[*few.motions][:1])
    comparison = compared(results)
    assert {1, len(rows) - 2, len(rows) - 1} <= {*shown_rows(comparison, ()).listed}
    with blank():
        table = study_lead(comparison).table
    assert table is not None
    verdicts = {row[0].rpartition("> ")[2]: row[1] for row in table.rows}
    assert len([label for label in verdicts if label.startswith("law")]) == min(count, 5)
    assert [*verdicts][min(count, 5) :] == [
        "Optimal passive, 100 %", "on", *([] if count > 4 else ["Passive-off"]), "uncontrolled",
    ]  # fmt: skip
    assert (verdicts[best.label], verdicts["on"]) == ("the reference", "the largest command")


def front_of(a_g: float, count: int) -> Lead:
    """The front of a frame of one storey under three motions at 2 m/s2 beside a target."""
    study = mr.study_of(
        building={"masses": [30e3], "stiffnesses": [3e7], "modal_damping": {"ratios": [0.035]}},
        dampers=[{"storey": 1, "preset": "kwok2006", "count": count}],
        laws=["best_passive"],
        motions=[mr.synthetic_motion(rng=seed, duration=5.0, peak=2.0, name=str(seed)) for seed in range(3)],
        target={"code": "en_1998", "a_g": a_g},
    )
    with blank():
        return study_lead(compared(mr.run_study(study, threads=1)))


@pytest.mark.contract
def test_a_suite_at_half_of_its_target_and_small_dampers_stand_on_the_front() -> None:
    weak = front_of(5.0, 5)
    assert ", damping 3.5 %; under 3 motions" in weak.subject
    at_half, small = weak.cautions
    ratio = float(at_half.partition(" times the target")[0].rpartition(" ")[2])
    assert 0.3 < ratio < 0.7
    assert "small for this structure" in small
    # Dampers that lock the storey are not small, whatever command is best.
    strong = front_of(5.0 * ratio, 150).cautions
    assert any("locks its storey" in each for each in strong)
    assert not any("times the target" in each or "are small" in each for each in strong)


@pytest.mark.contract
def test_the_front_has_the_damping_of_each_mode_and_sorts_numbers_as_numbers() -> None:
    results = study_samples.incremental()
    facts = replace(results.building, damping_ratios=(0.02, 309.017, 9.5, 0.1), yield_drifts=(17.5, 0.0, 9.0))
    subject = study_lead(compared(replace(results, building=facts))).subject
    assert "periods 0.500, 0.200, 0.100 s, damping 2.0, 30\u202f901.7, 950.0 %" in subject
    assert "yields at 9000 to 17\u202f500 mm of drift" in subject
