"""Figures of fits, of profiles and of models: true to the data, legible, no side effects."""

import math
import os
import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from blank_pictures import blank
from command_line import ran
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.text import Text
from report_samples import fit, prediction
from run_folders import write_fit

import mrwork as mr
from mrwork import StoredRun
from mrwork.identification.fit import SearchTrace
from mrwork.identification.interval import Interval, Verdict
from mrwork.plots import style
from mrwork.plots.canvas import svg_bytes
from mrwork.plots.of_tests import Motion, nominal_loops
from mrwork.plots.samples import even_samples, scattered_samples, zoom_window
from mrwork.report.fit import search
from mrwork.report.fit.figures import common_unit, few_cycles, history_figure, loop_figure, repair_figure
from mrwork.report.fit.later import profiles_figure
from mrwork.report.fit.page import fit_page, write_figures
from mrwork.uncertainty import Prediction, Profiles
from mrwork.uncertainty.identifiability.profile import Profile


def stored(*tested: Prediction, place: Path = Path()) -> StoredRun:
    return StoredRun(place=place, fit=fit(*tested))


def visible_texts(figure: Figure) -> list[Text]:
    """The texts that appear: matplotlib also keeps labels for ticks beyond the ends of an axis."""
    figure.draw_without_rendering()
    beyond = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            drawn = axis.get_transform().transform
            low, high = sorted(drawn(axis.get_view_interval()))
            slack = 1e-9 * (high - low)
            for tick in axis.get_major_ticks():
                if not low - slack <= drawn(tick.get_loc()) <= high + slack:
                    beyond |= {tick.label1, tick.label2}
    texts = figure.findobj(Text)
    return [text for text in texts if text.get_visible() and text.get_text().strip() and text not in beyond]


def with_model(tested: Prediction, scale: float) -> Prediction:
    return replace(tested, model_force=scale * tested.model_force)


def two_samples() -> Prediction:
    whole = prediction()
    pair = slice(0, 2)
    test = replace(
        whole.test,
        displacement=whole.test.displacement[pair],
        velocity=whole.test.velocity[pair],
        force=whole.test.force[pair],
    )
    return replace(whole, test=test, model_force=whole.model_force[pair])


CASES = {
    "ordinary": prediction(),
    "large force": prediction(peak_force=987_654.0),
    "diverged model": with_model(prediction(), float("nan")),
    "two samples": two_samples(),
}


@pytest.mark.parametrize("tested", CASES.values(), ids=CASES.keys())
def test_labels_stay_inside_the_figure_and_off_each_other(tested: Prediction) -> None:
    with style.drawn_in_style():
        unit = common_unit([tested])
        loops = (loop_figure(tested, unit, over) for over in get_args(Motion))
        for figure in (*(history_figure(each, unit) for each in (tested, few_cycles(tested))), *loops):
            assert_labels_apart(figure)


@pytest.mark.parametrize("best", [(2.0, 0.9, 0.07), (math.inf, 4e5, 3e-4), (0.5,), ()])
def test_convergence_is_drawn_for_any_trace(best: tuple[float, ...]) -> None:
    evaluations = tuple(10**6 * (1 + i) for i in range(len(best)))
    trace = SearchTrace(evaluations=evaluations, best=best, median=(math.inf,) * len(best), stop_reason="")
    with style.drawn_in_style():
        figure = search.convergence_figure(trace, 0.061 if best else math.inf)
        assert_labels_apart(figure)
    low, high = figure.axes[0].get_ylim()
    assert 0 < low < high < math.inf
    assert sum(low <= tick <= high for tick in figure.axes[0].get_yticks()) >= 2


def assert_labels_apart(figure: Figure) -> None:
    visible = visible_texts(figure)
    boxes = [(text.get_text(), text.get_window_extent()) for text in visible]
    assert len(boxes) > 4
    for text, box in boxes:
        assert box.x0 >= 0, text
        assert box.y0 >= 0, text
        assert box.x1 <= figure.bbox.width, text
        assert box.y1 <= figure.bbox.height, text
    for (first, one), (second, other) in combinations(boxes, 2):
        assert not one.overlaps(other), (first, second)
    for axes in figure.axes:
        outside = [text for text in visible if text not in axes.texts]
        assert not any(text.get_window_extent().overlaps(axes.get_window_extent()) for text in outside)


def test_the_report_never_loads_pyplot_and_a_run_is_read_without_matplotlib() -> None:
    def loaded_by(module: str) -> str:
        return ran(
            *(sys.executable, "-c"),
            f"import sys, {module}; print(*sorted(sys.modules))",
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            check=True,
        ).stdout

    assert "matplotlib.pyplot" not in loaded_by("mrwork.report.fit.page")
    assert "matplotlib" not in loaded_by("mrwork.store.run_folder")


@pytest.mark.contract
def test_the_model_line_is_whole_and_the_points_lie_on_the_record() -> None:
    tested = prediction(n_time=9000)
    for over in get_args(Motion):
        (axes,) = loop_figure(tested, "N", over).axes
        across = 1e3 * getattr(tested.test, over)
        points, line = axes.get_lines()[:2]
        assert np.array_equal(line.get_xydata(), np.column_stack([across, tested.model_force]))
        recorded = set(zip(across.tolist(), tested.test.force.tolist(), strict=True))
        drawn = [tuple(point) for point in np.asarray(points.get_xydata()).tolist()]
        assert set(drawn) <= recorded
        assert 300 < len(drawn) <= 600


@pytest.mark.contract
@given(cycles=st.integers(1, 40), noise=st.floats(0.0, 0.05), rng=st.integers(0, 10))
def test_the_window_holds_whole_cycles_and_noise_makes_none(cycles: int, noise: float, rng: int) -> None:
    period = 100
    phase = 2 * np.pi * np.arange(cycles * period) / period
    stroke = np.sin(phase + 0.3) + noise * np.random.default_rng(rng).normal(size=phase.size)
    window = zoom_window(stroke)
    assert 0 <= window.start < window.stop <= stroke.size
    if cycles < 3:
        assert zoom_window(np.arange(50.0)).in_words == "Middle of the record"
        return
    numbers = [int(word) for word in window.in_words.split() if word.isdigit()]
    n_cycles = numbers[-1] - numbers[0] + 1
    assert 1 <= n_cycles <= 3
    assert window.stop - 1 - window.start == pytest.approx(n_cycles * period, abs=12)
    assert n_cycles <= cycles / 2 + 0.5


@pytest.mark.contract
@given(n_time=st.integers(2, 3000), wanted=st.integers(50, 700), cycles=st.integers(1, 30))
def test_drawn_samples_follow_the_curve_without_bare_stretches(n_time: int, wanted: int, cycles: int) -> None:
    angle = 2 * np.pi * cycles * np.linspace(0, 1, n_time)
    across, up = np.cos(angle), np.tanh(8 * np.sin(angle))
    for drawn in (even_samples(across, up, wanted, aspect=1.0), scattered_samples(across, up, wanted)):
        assert drawn.size <= max(wanted, 1)
        assert np.all(np.diff(drawn) > 0)
        if n_time <= wanted:
            assert drawn.size == n_time
            continue
        steps = np.hypot(np.diff(across), np.diff(up)) / 2
        along = np.concatenate(([0.0], np.cumsum(steps)))
        # Two steps, for a jittered place may lie at either end of its own, and one sample on each side.
        assert np.diff(along[drawn]).max() <= 2 * along[-1] / wanted + 2 * steps.max()


@pytest.mark.contract
def test_the_figure_of_a_repair_holds_both_loops_whole() -> None:
    whole = prediction()
    raised = replace(whole.test, force=whole.test.force + 300.0)
    (axes,) = repair_figure(whole.test, raised, "N").axes
    before, after = (np.asarray(line.get_ydata()) for line in axes.get_lines()[:2])
    np.testing.assert_allclose(before, raised.force)
    np.testing.assert_allclose(after, whole.test.force)
    low, high = axes.get_ylim()
    assert low < after.min() < before.max() < high
    repaired = replace(whole, test=replace(whole.test, original=raised))
    own, others = ({*fit_page(stored(each), [each]).figures} for each in (whole, repaired))
    assert others - own == {"t1-repair"}


def test_figure_files_are_those_of_the_page_with_the_names_of_their_tables(tmp_path: Path) -> None:
    tested = [prediction(), prediction("second", synthetic=True)]
    place = write_fit(tmp_path / "run", fit(*tested))
    with blank():
        page = fit_page(stored(*tested, place=place), tested)
        names = write_figures(place, page)
    assert {"search", "t1-record", "t2-displacement"} <= {*names}
    assert {f"data/{name}.csv" for name in names} == {*page.files}
    files = {file.name for file in (place / "figures").iterdir()}
    assert files == {f"{name}.{kind}" for name in names for kind in ("png", "svg")}


@pytest.mark.contract
def test_nominal_loops_are_the_force_of_the_model() -> None:
    spec = mr.damper("bingham")
    force, scale, damping, offset = spec.nominal
    figure = nominal_loops(spec, amplitude=0.01, frequency=1.0)
    velocity, found = np.asarray(figure.axes[1].lines[0].get_xydata()).T
    velocity, unit = velocity / 1e3, 1e3 if "kN" in figure.axes[1].get_title(loc="left") else 1.0
    expected = force * np.tanh(velocity / scale) + damping * velocity + offset
    np.testing.assert_allclose(unit * found, expected, rtol=1e-9, atol=1e-9)
    assert np.ptp(figure.axes[0].lines[0].get_xdata()) == pytest.approx(20.0, rel=1e-5)


STEP = np.linspace(-2.2, 2.2, 9)
CLOSED = Profile(
    name="k",
    unit="N/m",
    estimate=10.0,
    log=False,
    values=tuple((10.0 + STEP).tolist()),
    misfit=tuple((0.1 + 0.001 * STEP**2).tolist()),
    ratio=tuple((STEP**2).tolist()),
    interval=Interval(kind="profile", level=0.95, lower=8.0, upper=12.0),
    verdict=Verdict("identifiable"),
)


def profiles(*made: Profile) -> Profiles:
    return Profiles(
        model="normalised_bouc_wen",
        level=0.95,
        threshold=3.84,
        misfit=0.1,
        n_time=1000,
        n_effective=100.0,
        profiles=made,
        status="finished",
        remarks=(),
        evaluations=100,
        seconds=1.0,
    )


@pytest.mark.contract
def test_each_parameter_has_a_panel_with_threshold_estimate_and_ends() -> None:
    figure = profiles_figure(profiles(*(replace(CLOSED, name=name) for name in ("c", "k_w", "rho"))))
    names = [axes.get_xlabel() for axes in figure.axes]
    assert names == ["c (N/m)", "k_w (N/m)", "ρ (N/m)"]
    for axes in figure.axes:
        assert any(np.allclose(line.get_ydata(), 3.84, atol=0.01) for line in axes.get_lines())
        assert axes.get_ylim()[1] > 3.84
        left, right = axes.get_xlim()
        assert left < 8.0 < 12.0 < right


def test_open_ends_are_marked_and_wide_and_lonely_profiles_are_drawn() -> None:
    above = replace(CLOSED.interval, upper=None, upper_end="bound")
    flat = tuple(np.where(STEP > 0.0, 0.3, 1.0) * STEP**2)
    (axes,) = profiles_figure(profiles(replace(CLOSED, ratio=flat, interval=above))).axes
    (marked,) = (text for text in axes.texts if text.get_text() == "open")
    assert marked.get_position()[0] > 0.5
    wide = replace(CLOSED, log=True, estimate=1.0, values=tuple(np.exp(1.2 * STEP).tolist()))
    (axes,) = profiles_figure(
        profiles(replace(wide, interval=replace(CLOSED.interval, lower=0.1, upper=10.0)))
    ).axes
    assert axes.get_xscale() == "log"
    lonely = replace(CLOSED, values=(10.0,), misfit=(0.1,), ratio=(0.0,), interval=replace(above, lower=None))
    assert svg_bytes(profiles_figure(profiles(lonely)))
