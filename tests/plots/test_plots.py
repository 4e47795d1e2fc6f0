"""Figures of results: what is drawn, where, in which units, and that it is what the table says."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import matplotlib as mpl
import numpy as np
import plotted_results
import pytest
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from plotted_results import RESULTS
from refusals import refusal

import mrwork as mr
from mrwork.drawing.style import symbol_text

# Units of labels, by what one of them is in SI.
UNITS = {
    "mm": 1e-3,
    "mm/s": 1e-3,
    "kN": 1e3,
    "m/s²": 1.0,
    "N": 1.0,
    "s": 1.0,
    "J": 1.0,
    "l": 1e-3,
    "g": 9.80665,
}
# Labels of ratios and counts have no unit.
UNITLESS = ("Likelihood ratio", "Dynamic range", "over i = 0")


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A figure of a type: options, and pairs of columns of which some line of the axes has the points."""

    figure: str
    kind: str
    options: dict[str, Any] = field(default_factory=dict)
    pairs: tuple[tuple[str, str], ...] = ()

    @property
    def result(self) -> Any:
        if (self.figure, self.kind) == ("laws", "StoredRun"):
            return plotted_results.run_with_laws()
        return RESULTS[self.kind]()


MODEL = ("Fit", "StoredRun", "Prediction")
RUNS = ("Responses", "StudyResults")
FORCE, BOTH = ("time", "force"), (("time", "force"), ("time", "model_force"))
SPECTRUM = (("period", "pseudo_acceleration"),)
DRAWN = [
    *(Drawn(figure="histories", kind=kind, pairs=BOTH) for kind in MODEL),
    Drawn(figure="histories", kind="DamperTest", pairs=(FORCE,)),
    Drawn(figure="histories", kind="GroundMotion", pairs=(("time", "ground_acceleration"),)),
    Drawn(figure="histories", kind="History", pairs=(("time", "drift"),)),
    *(
        Drawn(
            figure="loops",
            kind=kind,
            options={"over": over},
            pairs=((over, "force"), (over, "model_force"))[: 2 if kind in MODEL else 1],
        )
        for kind in (*MODEL, "DamperTest", "History")
        for over in ("displacement", "velocity")
    ),
    *(Drawn(figure="residuals", kind=kind, pairs=(("time", "residual"),)) for kind in MODEL),
    Drawn(
        figure="residuals", kind="Prediction", options={"over": "velocity"}, pairs=(("velocity", "residual"),)
    ),
    *(Drawn(figure="commands", kind=kind, pairs=(("time", "command"),)) for kind in ("DamperTest", *MODEL)),
    Drawn(figure="commands", kind="History", pairs=(("time", "command"), ("time", "current"))),
    *(
        Drawn(figure="laws", kind=kind, pairs=(("command", "f_c"), ("command", "c0")))
        for kind in ("Fit", "StoredRun")
    ),
    *(
        Drawn(figure="profiles", kind=kind, pairs=(("value", "ratio"),))
        for kind in ("Profiles", "Profile", "StoredRun")
    ),
    *(Drawn(figure="posterior", kind=kind) for kind in ("Draws", "StoredRun")),
    Drawn(
        figure="bands",
        kind="Prediction",
        options={"calibration": plotted_results.calibration},
        pairs=(*BOTH, ("time", "lower"), ("time", "upper")),
    ),
    Drawn(
        figure="bands", kind="StoredRun", options={"over": "velocity"}, pairs=(("velocity", "model_force"),)
    ),
    *(Drawn(figure="spectra", kind=kind, pairs=SPECTRUM) for kind in ("GroundMotion", "ResponseSpectrum")),
    Drawn(figure="building", kind="Building"),
    Drawn(figure="pushover", kind="Pushover", pairs=(("roof", "base_shear"),)),
    Drawn(figure="suite_spectra", kind="SuiteCheck", pairs=(("period", "mean"), ("period", "target"))),
    *(Drawn(figure="storey_profiles", kind=kind) for kind in RUNS),
    *(Drawn(figure="energies", kind=kind) for kind in RUNS),
    Drawn(figure="energies", kind="History", pairs=(("time", "input"),)),
    *(Drawn(figure="fronts", kind=kind) for kind in ("Front", "TuningResults")),
    Drawn(figure="ida", kind="Fragilities", options={"rows": ["uncontrolled", 1]}),
    Drawn(figure="fragility", kind="Fragilities", pairs=(("intensity", "reached"),)),
    Drawn(figure="fronts", kind="SizeFront", pairs=(("envelope_volume", "dynamic_range"),)),
]


def options_of(case: Drawn) -> dict[str, Any]:
    return {name: value() if callable(value) else value for name, value in case.options.items()}


def name_of(case: Drawn) -> str:
    return "-".join(
        (case.figure, case.kind, *map(str, filter(lambda each: isinstance(each, str), case.options.values())))
    )


@pytest.fixture(autouse=True)
def _nothing_is_left() -> Iterator[None]:
    """A test leaves no figure open that it has opened, and changes no setting of Matplotlib."""
    before = {name: mpl.rcParams[name] for name in mpl.rcParams}
    opened = plt.get_fignums()
    yield
    assert plt.get_fignums() == opened
    assert {name for name in before if mpl.rcParams[name] != before[name]} == set()


def axes_of(case: Drawn) -> Any:
    """Axes of the caller, as many as the figure takes."""
    count = {"laws": 2, "ida": 2, "profiles": 1 if case.kind == "Profile" else 2}.get(case.figure, 0)
    if case.figure == "posterior":
        n = len(plotted_results.draws().varied)
        return Figure().subplots(n, n)
    return Figure().subplots(1, count, squeeze=False)[0] if count else Figure().subplots()


def panels(axes: Any) -> list[Axes]:
    return [axes] if isinstance(axes, Axes) else [each for each in np.ravel(axes) if each.axison]


def factor(label: str) -> float:
    found = re.search(r"\(([^()]+)\)$", label)
    return UNITS.get(found[1], 1.0) if found else 1.0


def has_points(axes: Axes, table: NDArray[np.float64]) -> bool:
    """Whether the points of some line are all rows of a table with two columns."""
    units = np.array([factor(axes.get_xlabel()), factor(axes.get_ylabel())])
    spread = np.ptp(table, axis=0) + 1e-12
    for line in axes.get_lines():
        points = np.asarray(line.get_xydata()) * units
        if len(points) < 2 or not np.isfinite(points).all():
            continue
        away = np.abs((points[:, None] - table[None]) / spread).max(axis=2).min(axis=1)
        if away.max() < 1e-6:
            return True
    return False


@pytest.mark.parametrize("case", DRAWN, ids=name_of)
def test_a_figure_is_drawn_into_the_axes_that_are_given_and_shows_its_table(case: Drawn) -> None:
    result, options, given = case.result, options_of(case), axes_of(case)
    figure = getattr(mr.plots, case.figure)
    axes = figure(result, given, **options)
    if isinstance(given, Axes):
        assert axes is given
    else:
        assert [*np.ravel(axes)] == [*np.ravel(given)]
    shown = panels(axes)
    assert all(each.has_data() for each in shown)
    table = figure(result, data=True, **options)
    columns = table.reset_index()
    for across, up in case.pairs:
        flat = np.stack(
            [
                np.repeat(columns[across].to_numpy(float), np.ndim(columns[up]) and columns[[up]].shape[1]),
                columns[[up]].to_numpy(float).ravel(),
            ],
            axis=1,
        )
        assert any(has_points(each, flat[np.isfinite(flat).all(axis=1)]) for each in shown), (across, up)
    bare = panels(figure(result, axes_of(case), legend=False, **options))
    assert all(each.get_legend() is None for each in bare)
    short = getattr(result.plot, case.figure)(data=True, **options)
    assert short.equals(table)
    assert table.attrs["units"] or case.figure == "fronts"
    for each in bare:
        for label in (each.get_xlabel(), each.get_ylabel()):
            named = not label or label.endswith(UNITLESS) or re.search(r"\([^()]+\)$", label)
            assert named or label in plotted_results.draws().noise_names, label
    # A drawing of a building has no axes.
    assert case.figure == "building" or any(each.get_xlabel() for each in bare)


def test_a_chain_of_floors_is_drawn_in_a_notebook() -> None:
    html = mr.building("uts")._repr_html_()
    assert html.count("<svg") == html.count("</svg>") == 1
    assert "<svg" not in mr.building("sac3")._repr_html_()


def accepted(figure: str) -> set[str]:
    """Types that a function takes, by its annotation."""
    function = getattr(mr.plots, figure)
    annotation = inspect.signature(function).parameters["result"].annotation
    return set(str(annotation).split(" | "))


def test_every_type_of_every_figure_is_tested() -> None:
    assert {(case.figure, case.kind) for case in DRAWN} == {
        (figure, kind) for figure in dir(mr.plots) for kind in accepted(figure)
    }


@pytest.mark.parametrize("kind", RESULTS)
def test_a_result_has_the_figures_that_take_it_and_no_others(kind: str) -> None:
    result = RESULTS[kind]()
    # What it says of itself, in a terminal and in a notebook.
    assert len(repr(result)) < 4000
    assert result._repr_html_().startswith("<div")
    methods = {name for name in dir(result.plot) if not name.startswith("_")} - {"result"}
    assert methods == {figure for figure in dir(mr.plots) if kind in accepted(figure)}
    assert all(name in repr(result.plot) for name in methods)


def test_without_axes_a_figure_of_the_users_is_opened_and_with_data_none() -> None:
    test = RESULTS["DamperTest"]()
    for draw in (test.plot.loops, RESULTS["Profiles"]().plot.profiles, RESULTS["Draws"]().plot.posterior):
        before = len(plt.get_fignums())
        draw(data=True)
        assert len(plt.get_fignums()) == before
        axes = draw()
        assert panels(axes)[0].figure.number == plt.get_fignums()[-1]
        assert len(plt.get_fignums()) == before + 1
    plt.close("all")


def test_single_parameters_are_drawn_into_single_axes() -> None:
    for draw, options in (
        (RESULTS["Draws"]().plot.posterior, {"parameters": ["k_w"]}),
        (RESULTS["Profiles"]().plot.profiles, {"parameters": ["rho"]}),
        (RESULTS["Fit"]().plot.laws, {"parameters": ["f_c"]}),
    ):
        axes = Figure().subplots()
        assert np.ravel(draw(axes, **options)).tolist() == [axes]
        assert f"{symbol_text(options['parameters'][0])} (" in f"{axes.get_xlabel()} {axes.get_ylabel()}"


def test_bars_and_profiles_have_the_numbers_of_their_tables() -> None:
    study = RESULTS["StudyResults"]()
    axes = study.plot.energies(Figure().subplots())
    widths = np.array([each.get_width() for each in axes.patches]).reshape(3, -1)
    assert np.allclose(widths[:, ::-1].T, study.plot.energies(data=True).to_numpy())
    for quantity, unit in (("peak_drift", 1e3), ("peak_acceleration", 1.0)):
        axes = study.plot.storey_profiles(Figure().subplots(), quantity=quantity)
        lines = np.array([line.get_xdata() for line in axes.get_lines()])
        assert np.allclose(
            lines.ravel() / unit, study.plot.storey_profiles(quantity=quantity, data=True)[quantity]
        )
    front = RESULTS["Front"]()
    axes, table = front.plot.fronts(Figure().subplots()), front.plot.fronts(data=True)
    for line, use in zip(axes.get_lines(), ("train", "test"), strict=True):
        assert np.array_equal(np.asarray(line.get_xydata()), table[use].to_numpy())


def test_a_posterior_counts_nearly_every_draw() -> None:
    draws = RESULTS["Draws"]()
    axes = draws.plot.posterior(Figure().subplots(), parameters=["k_w"])[0, 0]
    table = draws.plot.posterior(parameters=["k_w"], data=True)
    # Single outliers would compress the rest, and are left out.
    assert 0.99 * len(table) <= axes.patches[0].get_data().values.sum() <= len(table)


def test_rows_tests_and_motions_are_chosen_by_name_or_number() -> None:
    responses, fit = RESULTS["Responses"](), RESULTS["Fit"]()
    by_name = responses.plot.energies(motion="motion 2", rows=["candidate 2"], data=True)
    assert by_name.equals(responses.plot.energies(motion=1, rows=[2], data=True))
    assert len(by_name) == 1
    assert fit.plot.histories(test="0.7 A", data=True).equals(fit.plot.histories(test=1, data=True))
    assert fit.plot.loops(data=True)["test"].unique().tolist() == ["0 A", "0.7 A", "1.5 A"]
    assert fit.plot.loops(test=2, data=True)["test"].unique().tolist() == ["1.5 A"]


def test_what_a_result_does_not_have_says_how_to_get_it() -> None:
    run = replace(RESULTS["StoredRun"](), draws=None, profiles=None, bands=None, place="run")
    refusal(run.plot.posterior, match="mrwork sample run")
    refusal(run.plot.profiles, match="mrwork profile run")
    refusal(run.plot.bands, match="mrwork calibrate run")
    refusal(replace(RESULTS["Fit"](), tests=()).plot.loops, match="has no tests")
    refusal(run.plot.laws, match="with_current_laws")
    refusal(RESULTS["Prediction"]().plot.bands, match="`calibration`")
    refusal(plotted_results.small_test().plot.commands, match="unknown")
    refusal(plotted_results.tuning().plot.fronts, match="`objectives`")
    refusal(mr.plots.posterior, RESULTS["Fit"](), match="Draws")


def test_what_there_is_not_is_refused_with_what_there_is() -> None:
    history, responses = RESULTS["History"](), RESULTS["Responses"]()
    refusal(history.plot.histories, signal="drfit", match="did you mean drift")
    refusal(history.plot.loops, device=9, match="2 dampers")
    refusal(responses.plot.energies, motion="motion 3", match="motion 2")
    refusal(responses.plot.energies, rows=[7], match="3 rows")
    refusal(RESULTS["Profiles"]().plot.profiles, Figure().subplots(), match="2 axes")
    refusal(RESULTS["ResponseSpectrum"]().plot.spectra, damping=0.02, match="its own")
