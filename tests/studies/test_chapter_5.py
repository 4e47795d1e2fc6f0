"""The study of chapter 5 at few currents, on dampers whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mrwork as mr
from mrwork.search import EfficientGA, StopRules
from studies.chapter_5.damper_tests import FORCE_NOISE_N, RD_1005_3, TestSet, measured_sets, synthetic_sets
from studies.chapter_5.loop_branches import branches
from studies.chapter_5.outcome import (
    STATIC,
    Fitting,
    PerCurrent,
    SetOutcome,
    identify_each,
    laws_of,
    study_set,
)
from studies.chapter_5.page import branches_figure, write_page
from studies.chapter_5.tables import per_current_table
from studies.chapter_5.thickness_and_mean import compared, loops_table

FITTING = Fitting(search=EfficientGA(population=40, stop=StopRules(max_generations=40)), rng=1)
# Three are the fewest that a quadratic law can be found from.
CURRENTS = (0.5, 1.0, 1.5)
# The RMS of n white samples scatters by 1/sqrt(2 n), 2.2 % for the thousand here.
SCATTER = 0.1


@pytest.fixture(scope="module")
def sets() -> tuple[TestSet, ...]:
    return synthetic_sets(seed=1, currents=CURRENTS, frequencies=(1.0,))


@pytest.fixture(scope="module")
def static(sets: tuple[TestSet, ...]) -> SetOutcome:
    return study_set(sets[0], (STATIC,), FITTING)


def test_the_true_model_is_recovered_at_each_current(static: SetOutcome) -> None:
    each = static.each[STATIC.label]
    for name in STATIC.free:
        place = mr.damper(STATIC.damper).names.index(name)
        true = np.polynomial.polynomial.polyval(each.currents, RD_1005_3[name])
        assert np.all(abs(each.values[:, place] - true) < 5.0 * each.errors[:, place]), name


def test_the_true_model_leaves_the_noise(static: SetOutcome) -> None:
    each, laws = static.each[STATIC.label], static.laws[STATIC.label]
    for rms in (each.rms_n, laws.joint.rms_n, static.true_laws.rms_n):
        np.testing.assert_allclose(rms, FORCE_NOISE_N, rtol=SCATTER)


def test_the_joint_laws_are_the_true_ones(static: SetOutcome) -> None:
    joint = static.laws[STATIC.label].joint
    for name in STATIC.free:
        deviation = np.subtract(joint.coefficients[name], RD_1005_3[name])
        # A beta that holds at every current is found from all of them.
        assert np.all(abs(deviation) < 5.0 * np.array(joint.errors[name])), name


def test_a_law_of_as_many_numbers_as_currents_passes_through_the_values(static: SetOutcome) -> None:
    laws, each = static.laws[STATIC.label], static.each[STATIC.label]
    place = mr.damper(STATIC.damper).names.index("alpha")
    for way in (laws.through, laws.weighted):
        np.testing.assert_allclose(way.at("alpha", each.currents), each.values[:, place], rtol=1e-9)


def test_a_damper_that_the_model_is_not_leaves_more_than_the_noise(sets: tuple[TestSet, ...]) -> None:
    largest = replace(sets[1], tests=sets[1].tests[-1:])
    each = identify_each(STATIC, largest, FITTING)
    assert np.all(each.rms_n > (1.0 + SCATTER) * FORCE_NOISE_N)


def test_wrong_laws_are_told_by_their_error(sets: tuple[TestSet, ...]) -> None:
    wrong = laws_of(STATIC, RD_1005_3 | {"alpha": (32.0, 0.0, 0.0)}, sets[0])
    assert np.all(wrong.rms_n > 10.0 * FORCE_NOISE_N)


def test_a_value_without_standard_error_is_marked(static: SetOutcome) -> None:
    each = static.each[STATIC.label]
    unsure = replace(each.fits[0].estimates[0], standard_error=None)
    fit = replace(each.fits[0], estimates=(unsure, *each.fits[0].estimates[1:]))
    table = per_current_table(static, PerCurrent(model=STATIC, currents=each.currents[:1], fits=(fit,)))
    assert [cell.endswith("*") for cell in table.rows[0]] == [
        name == "c" for name in ("i", *STATIC.free, "rms")
    ]


def test_loops_of_the_true_model_differ_by_the_scatter_of_the_cycles(static: SetOutcome) -> None:
    loops = compared(static)
    for name, missed in loops.missed[STATIC.label].items():
        # The scatter is a standard error, found from three cycles.
        assert np.all(missed < 2.0 * loops.scatter[name]), name
    np.testing.assert_allclose(loops.models[STATIC.label].thickness, loops.tests.thickness, rtol=0.05)
    assert np.all(np.diff(loops.tests.thickness) > 0.0)
    assert len(loops_table(static).rows) == len(CURRENTS)


def test_loops_of_a_wrong_model_differ_by_more(static: SetOutcome) -> None:
    each = static.each[STATIC.label]
    wrong = replace(static, each={STATIC.label: replace(each, fits=each.fits[::-1])})
    missed = compared(wrong).missed[STATIC.label]
    # The middle one is in its place.
    assert np.all(missed["thickness"][[0, 2]] > 0.2)
    assert np.all(missed["mean"][[0, 2]] > 0.2)


@pytest.mark.parametrize("over", ["velocity", "displacement"])
def test_the_panels_are_thickness_and_mean_of_test_and_model(over: str) -> None:
    test = replace(mr.synthetic_test("rd1005_1a"), current=1.0)
    force = 0.5 * test.force
    figure = branches_figure([test], [force], over)
    loop, model = branches(test, over=over), branches(test, over=over, force=force)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [f"{test.current:g} A"]
    for axes, quantity in zip(figure.axes, ("thickness", "mean"), strict=True):
        points, line = axes.lines[0].get_xydata(), axes.lines[1].get_xydata()
        np.testing.assert_allclose(points.T[1], getattr(loop, quantity).mean(axis=0)[::2])
        np.testing.assert_allclose(line.T[0], 1e3 * model.abscissa)
        np.testing.assert_allclose(line.T[1], getattr(model, quantity).mean(axis=0))
        band = axes.collections[0].get_paths()[0].vertices
        deviation = getattr(loop, quantity).std(axis=0, ddof=1)
        assert np.ptp(band[:, 1]) >= np.ptp(points.T[1]) + deviation.min()


def test_the_page_stands_alone_and_calls_synthetic_data_synthetic(static: SetOutcome, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    write_page([static], page, skipped="Skipped: no records.", footer="Seed 1.")
    text = page.read_text(encoding="utf-8")
    assert '<span class="tag">synthetic</span>' in text
    assert "Skipped: no records." in text
    assert "measured" not in text
    assert "$" not in text
    for outside in ('src="', "url(http", "<link", "<script"):
        assert outside not in text


def test_without_the_records_there_is_no_measured_set(tmp_path: Path) -> None:
    assert measured_sets(tmp_path) == ()
