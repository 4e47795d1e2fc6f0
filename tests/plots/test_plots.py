"""Figures of results: what is drawn, where, in which units, and that it is what the result says."""

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import plotted_results
import pytest
import study_samples
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from plotted_results import RESULTS
from refusals import refusal

import mrwork as mr
from mrwork.dampers.spec import law_values
from mrwork.identification.fit_file import reopen
from mrwork.plots.of_studies import energy_parts
from mrwork.plots.style import symbol_text
from mrwork.uncertainty.bands.prediction import predictions_of
from mrwork.uncertainty.identifiability.profile import Profile, Profiles

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
UNITLESS = ("Likelihood ratio", "Dynamic range", "over i = 0", "Dampers in each place")


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A figure of a type: options, and pairs of `numbers_of` of which some curve has the points."""

    figure: str
    kind: str
    options: dict[str, Any] = field(default_factory=dict)
    pairs: tuple[tuple[str, str], ...] = ()

    @property
    def result(self) -> Any:
        if (self.figure, self.kind) == ("laws", "StoredRun"):
            return plotted_results.run_with_laws()
        if (self.figure, self.kind) == ("building", "StudyResults"):
            return study_samples.incremental()
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
        Drawn(figure="laws", kind=kind, pairs=(("over", "law of f_c"), ("over", "law of c0")))
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
        pairs=(*BOTH, ("counted", "lower"), ("counted", "upper")),
    ),
    Drawn(
        figure="bands",
        kind="StoredRun",
        options={"over": "velocity"},
        pairs=(("band of velocity", "band of model_force"),),
    ),
    *(Drawn(figure="spectra", kind=kind, pairs=SPECTRUM) for kind in ("GroundMotion", "ResponseSpectrum")),
    *(Drawn(figure="building", kind=kind) for kind in ("Building", "StudyResults")),
    Drawn(figure="pushover", kind="Pushover", pairs=(("roof", "base_shear"),)),
    Drawn(figure="suite_spectra", kind="SuiteCheck", pairs=(("period", "mean"), ("period", "target"))),
    *(Drawn(figure="storey_profiles", kind=kind) for kind in RUNS),
    *(Drawn(figure="energies", kind=kind) for kind in RUNS),
    Drawn(figure="energies", kind="History", pairs=(("time", "input"),)),
    *(Drawn(figure="fronts", kind=kind) for kind in ("Front", "TuningResults", "TunedStudy")),
    Drawn(figure="ida", kind="Fragilities", options={"rows": ["uncontrolled", 1]}),
    Drawn(figure="fragility", kind="Fragilities", pairs=(("intensity", "reached"),)),
    Drawn(figure="damper_counts", kind="DamperCounts", pairs=(("dampers", "reached"),)),
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


def of_test(test: mr.DamperTest, force: Any) -> dict[str, Any]:
    channels = {name: getattr(test, name) for name in ("time", "displacement", "velocity", "force")}
    command = np.broadcast_to(np.nan if test.current is None else test.current, test.n_time)
    return channels | {"command": command, "model_force": force, "residual": test.force - force}


def numbers_of(result: Any) -> dict[str, Any]:
    """Numbers of a result in SI by name: of its first test, damper or arrangement."""
    match result:
        case mr.Fit(spec=spec, theta=theta, tests=(test, *_), forces=(force, *_)):
            commands = np.linspace(0.0, 1.5, 101)
            laws = law_values(spec, np.array(theta), commands)
            values = {f"law of {parameter.name}": values for parameter, values in laws}
            return of_test(test, force) | {"over": commands} | values
        case mr.StoredRun(fit=fit, profiles=profiles, bands=bands):
            opened = reopen(result.place)
            (tested, *_) = predictions_of(opened.fit, opened.tests)
            assert profiles is not None
            assert bands is not None
            banded = {f"band of {name}": each for name, each in numbers_of(bands.predictions[0]).items()}
            shown = numbers_of(fit) if fit.tests else of_test(tested.test, tested.model_force)
            return shown | numbers_of(profiles) | banded
        case mr.Prediction(test=test, model_force=force):
            band = plotted_results.calibration().band(result, 0.9)
            ends = {"counted": test.time[test.counted], "lower": band.lower, "upper": band.upper}
            return of_test(test, force) | ends
        case mr.DamperTest():
            return of_test(result, np.nan)
        case Profiles(profiles=(first, *_)):
            return numbers_of(first)
        case Profile():
            return {"value": result.values, "ratio": result.ratio}
        case mr.GroundMotion():
            spectrum = mr.response_spectrum(result, np.geomspace(0.05, 4.0, 120))
            return {"time": result.time, "ground_acceleration": result.acceleration} | numbers_of(spectrum)
        case mr.motions.ResponseSpectrum():
            return {"period": result.periods, "pseudo_acceleration": result.pseudo_acceleration}
        case mr.closed_loop.History():
            signals = ("deformation", "rate", "force", "command", "current")
            first = {name: result.numbers[name][:, 0] for name in signals}
            motion = {"displacement": first["deformation"], "velocity": first["rate"]}
            storeys = {
                "time": result.time,
                "drift": result.drift[:, 0],
                "input": result.numbers["input_energy"],
            }
            return first | motion | storeys
        case mr.buildings.Pushover():
            return {"roof": result.roof, "base_shear": result.base_shear}
        case mr.motions.SuiteCheck():
            target = result.target.acceleration(result.periods)
            return {"period": result.periods, "mean": result.mean, "target": target}
        case mr.study.Fragilities():
            one = next(iter(result.rows.values()))
            return {"intensity": one.levels, "reached": one.crossed}
        case mr.study.DamperCounts(rows=(row, *_)):
            return {
                "dampers": [each.uniform for each in row.tried],
                "reached": [each.value for each in row.tried],
            }
    return {}


def has_points(drawn: pd.DataFrame, across: Any, up: Any) -> bool:
    """Whether all points of some curve are pairs of these numbers."""
    expected = np.stack([np.asarray(across, dtype=float), np.asarray(up, dtype=float)], axis=1)
    spread = np.ptp(expected, axis=0) + 1e-12
    for _, curve in drawn.groupby(["panel", "curve"], sort=False):
        units = np.array([factor(curve["abscissa"].iloc[0]), factor(curve["ordinate"].iloc[0])])
        points = curve[["x", "y"]].to_numpy() * units
        if len(points) < 2 or not np.isfinite(points).all():
            continue
        away = np.abs((points[:, None] - expected[None]) / spread).max(axis=2).min(axis=1)
        if away.max() < 1e-6:
            return True
    return False


@pytest.mark.parametrize("case", DRAWN, ids=name_of)
def test_a_figure_is_drawn_into_the_axes_that_are_given_and_shows_its_numbers(case: Drawn) -> None:
    result, options, given = case.result, options_of(case), axes_of(case)
    figure = getattr(mr.plots, case.figure)
    axes = figure(result, given, **options)
    if isinstance(given, Axes):
        assert axes is given
    else:
        assert [*np.ravel(axes)] == [*np.ravel(given)]
    assert all(each.has_data() for each in panels(axes))
    drawn, numbers = mr.plots.drawn_data(axes), numbers_of(result)
    for across, up in case.pairs:
        assert has_points(drawn, numbers[across], numbers[up]), (across, up)
    drawn_once_more = mr.plots.drawn_data(getattr(result.plot, case.figure)(axes_of(case), **options))
    assert drawn_once_more.equals(drawn)
    if "legend" in inspect.signature(figure).parameters:
        axes = figure(result, axes_of(case), legend=False, **options)
        assert all(each.get_legend() is None for each in panels(axes))
    for each in panels(axes):
        for label in (each.get_xlabel(), each.get_ylabel()):
            named = not label or label.endswith(UNITLESS) or re.search(r"\([^()]+\)$", label)
            assert named or label in plotted_results.draws().noise_names, label
    # A drawing of a building has no axes.
    assert case.figure == "building" or any(each.get_xlabel() for each in panels(axes))


def test_forces_of_figures_that_are_compared_have_one_unit() -> None:
    for kind in ("DamperTest", "Prediction", "History"):
        axes = RESULTS[kind]().plot.loops(Figure().subplots(), unit="kN")
        assert axes.get_ylabel() == "Force (kN)"
    axes = RESULTS["Prediction"]().plot.histories(Figure().subplots(), unit="mN")
    assert axes.get_ylabel() == "Force (mN)"
    refusal(RESULTS["Prediction"]().plot.residuals, unit="lbf", match="kN")


def test_curves_without_a_legend_have_their_names_in_the_table() -> None:
    fit, check = RESULTS["Fit"](), RESULTS["SuiteCheck"]()
    curves = mr.plots.drawn_data(fit.plot.loops(Figure().subplots()))["curve"].unique().tolist()
    assert curves == ["0 A", "0 A, model", "0.7 A", "0.7 A, model", "1.5 A", "1.5 A, model"]
    suite = mr.plots.drawn_data(check.plot.suite_spectra(Figure().subplots()))
    assert suite["curve"].unique().tolist()[:3] == ["Motions", "Mean", check.target.name]


def test_a_table_has_the_panels_of_a_figure_and_names_where_an_axis_has_names() -> None:
    profiles, study = RESULTS["Profiles"](), RESULTS["StudyResults"]()
    panels = profiles.plot.profiles(Figure().subplots(1, 2))
    table = mr.plots.drawn_data(panels)
    assert table["panel"].unique().tolist() == ["1", "2"]
    assert table.equals(mr.plots.drawn_data(panels[0].figure))
    # The threshold runs across the panel.
    assert table[table["x"].isna()]["y"].unique().tolist() == [profiles.threshold]
    heights = mr.plots.drawn_data(study.plot.storey_profiles(Figure().subplots()))
    assert heights["y"].unique().tolist() == list(study.quantities.axes["storey"])


def test_a_chain_of_floors_is_drawn_in_a_notebook() -> None:
    html = mr.building("uts")._repr_html_()
    assert html.count("<svg") == html.count("</svg>") == 1
    assert "<svg" not in mr.building("sac3")._repr_html_()


FIGURES = [name for name in dir(mr.plots) if name != "drawn_data"]


def accepted(figure: str) -> set[str]:
    """Types that a function takes, by its annotation."""
    function = getattr(mr.plots, figure)
    annotation = inspect.signature(function).parameters["result"].annotation
    return set(str(annotation).split(" | "))


def test_every_type_of_every_figure_is_tested() -> None:
    assert {(case.figure, case.kind) for case in DRAWN} == {
        (figure, kind) for figure in FIGURES for kind in accepted(figure)
    }


@pytest.mark.parametrize("kind", RESULTS)
def test_a_result_has_the_figures_that_take_it_and_no_others(kind: str) -> None:
    result = RESULTS[kind]()
    # What it says of itself, in a terminal and in a notebook.
    assert len(repr(result)) < 4000
    assert result._repr_html_().startswith("<div")
    kinds = {each.__name__ for each in type(result).__mro__}
    assert dir(result.plot) == [figure for figure in FIGURES if kinds & accepted(figure)]
    assert all(name in repr(result.plot) for name in dir(result.plot))
    for name in ("drawn_data", "sheet", *({*FIGURES} - {*dir(result.plot)})):
        with pytest.raises(
            AttributeError, match=f"{kind} has no figure '{name}'; it has {dir(result.plot)[0]}"
        ):
            getattr(result.plot, name)


def test_editors_know_the_figures_of_results() -> None:
    (plots,) = (
        node
        for node in ast.parse((Path(mr.plots.__file__).parent / "accessor.pyi").read_text()).body
        if isinstance(node, ast.ClassDef)
    )
    listed = [ast.unparse(node) for node in plots.body if isinstance(node, ast.Assign)]
    assert sorted(line.partition(" = ")[0] for line in listed) == FIGURES
    assert all(line.endswith(f".{line.partition(' = ')[0]}") for line in listed)


def test_without_axes_a_figure_of_the_users_is_opened() -> None:
    test = RESULTS["DamperTest"]()
    for draw in (test.plot.loops, RESULTS["Profiles"]().plot.profiles, RESULTS["Draws"]().plot.posterior):
        before = len(plt.get_fignums())
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


def test_bars_and_profiles_have_the_numbers_of_their_runs() -> None:
    study = RESULTS["StudyResults"]()
    runs = [study.quantities.at(row, 0) for row in study.finished_rows(0)]
    bars = mr.plots.drawn_data(study.plot.energies(Figure().subplots()))
    widths = bars.groupby(["curve", "y"], sort=False)["x"].agg(np.ptp).to_numpy().reshape(3, -1)[:, ::-1].T
    unit = factor(bars["abscissa"][0])
    assert np.allclose(unit * widths, [energy_parts(run) for run in runs])
    for quantity, unit in (("peak_drift", 1e-3), ("peak_acceleration", 1.0)):
        axes = study.plot.storey_profiles(Figure().subplots(), quantity=quantity, motion=0)
        drawn = unit * mr.plots.drawn_data(axes)["x"].to_numpy()
        assert np.allclose(drawn, np.concatenate([run[quantity] for run in runs]))
    front = RESULTS["Front"]()
    axes, table = front.plot.fronts(Figure().subplots()), front.to_pandas()
    for line, use in zip(axes.get_lines(), ("train", "test"), strict=True):
        assert np.array_equal(np.asarray(line.get_xydata()), table[use].to_numpy())


def test_profiles_of_a_study_are_means_over_the_judged_motions_in_ratios_where_heights_are_known() -> None:
    study = study_samples.incremental()
    axes = study.plot.storey_profiles(Figure().subplots(), quantity="peak_drift_ratio", rows=[0], behind=[1])
    front, behind = axes.get_lines()[:2]
    peaks = study.quantities.peak_drift[0, list(study.judged_motions), 0]
    ratios = 100.0 * peaks / study.building.heights
    assert np.allclose(front.get_xdata(), ratios.mean(axis=0))
    assert front.get_zorder() > behind.get_zorder()
    (shaded,) = axes.collections
    assert np.isclose(shaded.get_paths()[0].vertices[:, 0].max(), ratios.max())
    refusal(RESULTS["StudyResults"]().plot.storey_profiles, quantity="peak_drift_ratio", match="peak_drift")


def test_a_posterior_counts_nearly_every_draw() -> None:
    draws = RESULTS["Draws"]()
    axes = draws.plot.posterior(Figure().subplots(), parameters=["k_w"])[0, 0]
    # Single outliers would compress the rest, and are left out.
    count = draws.chain("k_w").size
    assert 0.99 * count <= axes.patches[0].get_data().values.sum() <= count


def test_rows_tests_and_motions_are_chosen_by_name_or_number() -> None:
    responses, fit = RESULTS["Responses"](), RESULTS["Fit"]()

    def drawn(figure: Callable[..., Axes], **options: Any) -> pd.DataFrame:
        return mr.plots.drawn_data(figure(Figure().subplots(), **options))

    by_name = drawn(responses.plot.energies, motion="motion 2", rows=["candidate 2"])
    assert by_name.equals(drawn(responses.plot.energies, motion=1, rows=[2]))
    assert by_name["y"].unique().tolist() == ["candidate 2"]
    by_name = drawn(fit.plot.histories, test="0.7 A")
    assert by_name.equals(drawn(fit.plot.histories, test=1))
    assert not by_name.equals(drawn(fit.plot.histories))
    assert drawn(fit.plot.loops, test=2)["curve"].unique().tolist() == ["measured", "model"]


def test_what_a_result_does_not_have_says_how_to_get_it() -> None:
    run = replace(RESULTS["StoredRun"](), draws=None, profiles=None, bands=None, place="run")
    refusal(run.plot.posterior, match="mrwork intervals --posterior run")
    refusal(run.plot.profiles, match="mrwork intervals run")
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
