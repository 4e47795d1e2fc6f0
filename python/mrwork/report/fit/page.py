"""The page of a fit with a section for each addition of a later verb, and the figure files of a run."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from mrwork.base import numbers
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import reopen
from mrwork.identification.result import free_run
from mrwork.records import DamperTest
from mrwork.report import figures
from mrwork.report.canvas import png_bytes, svg_bytes
from mrwork.report.figures import Comparison
from mrwork.report.fit.agreement import (
    AMPLITUDES,
    agreement_rows,
    blocks_of_tests,
    count_findings,
    drawn_in_full,
    has_small_loops,
    overview,
)
from mrwork.report.fit.bands import BANDS
from mrwork.report.fit.choices import LAWS, PLAN, RANKING, plan_figure, ranking_figure
from mrwork.report.fit.coverage import COVERAGE
from mrwork.report.fit.parameters import (
    IDENTIFIABILITY,
    PROFILES,
    TESTED_RANGE,
    caution,
    parameter_rows,
    profiles_figure,
)
from mrwork.report.fit.posterior import POSTERIOR
from mrwork.report.fit.residuals import RESIDUALS
from mrwork.report.fit.search import search_facts, search_figure, search_panels
from mrwork.report.html import equation_html, fill_template
from mrwork.report.section import OnDrawn, PageProgress, SectionKind, ignore_progress
from mrwork.runs.load import StoredRun, with_additions
from mrwork.store.output_file import write_files
from mrwork.store.run_folder import FIGURES, REPORT
from mrwork.uncertainty.identifiability.verdicts import identifiability_of

SECTIONS: tuple[SectionKind, ...] = (
    TESTED_RANGE,
    IDENTIFIABILITY,
    PROFILES,
    POSTERIOR,
    RESIDUALS,
    AMPLITUDES,
    BANDS,
    COVERAGE,
    RANKING,
    LAWS,
    PLAN,
)
"""The sections after the search, in their order on the page."""

_STATUS = {
    "converged": "Converged",
    "not_converged": "Not converged",
    "interrupted": "Interrupted",
    "stopped": "Stopped",
}
_BANNER = {
    "interrupted": "This identification was interrupted. The parameters below are the best found until then, "
    "not the end of the search.",
    "stopped": "This identification was stopped on request. The parameters below are the best found until then, "
    "not the end of the search.",
    "not_converged": "The search stopped before it converged{reason}. The parameters below may still improve.",
}
# Entries of a setting that are shown.
_SETTINGS_SHOWN = 12
_HASH_SHOWN = 12


def comparisons_of(fit: Fit, tests: Sequence[DamperTest]) -> tuple[Comparison, ...]:
    """The tests of a fit, each with the force that its model gives; simulated where the fit was read from its file."""
    theta = np.array(fit.theta)
    tests = [fit.observed(test) for test in tests]
    forces = fit.forces or tuple(
        free_run(fit.spec, theta, test, nuisances=fit.nuisances)[0] for test in tests
    )
    return tuple(
        Comparison(test=test, model_force=force, quality=quality)
        for test, force, quality in zip(tests, forces, fit.quality, strict=True)
    )


def fit_page(
    run: StoredRun,
    comparisons: Sequence[Comparison],
    *,
    every_test: bool = False,
    on_progress: OnDrawn = ignore_progress,
) -> str:
    """The page of a run: its fit, `comparisons` with the tests of the fit, and what later verbs have added.

    Of many tests the best, the median and the worst are drawn in full, or with `every_test` all.
    """
    drawn = drawn_in_full(comparisons, every_test=every_test)
    total = len(SECTIONS) + len(drawn) + (len(comparisons) if has_small_loops(comparisons) else 0)
    done = itertools.count()

    def before(task: str) -> None:
        on_progress(PageProgress(done=next(done), total=total, task=task))

    made = []
    for kind in SECTIONS:
        before("sections of the page")
        made.append((kind, kind.make(run, comparisons)))
    fit = run.fit
    *agreement, overall = agreement_rows(fit, comparisons)
    synthetic = {
        name
        for comparison in comparisons
        if comparison.test.synthetic
        for name in (comparison.test.path, comparison.test.name)
    }
    return fill_template(
        "fit.html.j2",
        fit=fit,
        equation=Markup(equation_html(fit.spec.equation)),
        status=_STATUS[fit.status],
        status_detail=_status_detail(fit),
        banner=_BANNER.get(fit.status, "").format(
            reason=f": {fit.status_reason}" if fit.status_reason else ""
        ),
        headline=_headline(fit),
        tests=[(comparison.test.name, comparison.test.synthetic) for comparison in comparisons],
        parameters=parameter_rows(fit),
        caution=caution(fit),
        overall=overall,
        overview=overview(comparisons, before=before),
        blocks=blocks_of_tests(comparisons, agreement, drawn=drawn, before=before),
        searched=search_panels(fit),
        search=search_facts(fit),
        sections=[section for _, section in made if section is not None],
        checked=count_findings(comparisons),
        absent=[kind.absent for kind, section in made if section is None and kind.absent is not None],
        settings=[(name, _plain(value)) for name, value in fit.provenance.settings.items() if value],
        inputs=[
            (name, digest, digest[:_HASH_SHOWN], name in synthetic)
            for name, digest in fit.provenance.inputs.items()
        ],
    )


def open_run(place: str | Path) -> tuple[StoredRun, tuple[Comparison, ...]]:
    """The run folder at `place` with everything that it holds, and the tests of its fit, for a page or for figures."""
    opened = reopen(place)
    fit = opened.fit
    if fit.identifiability is None:
        # That of an interrupted run is not stored.
        fit = fit.with_identifiability(identifiability_of(fit, opened.tests))
    return with_additions(opened.place, fit), comparisons_of(fit, opened.tests)


def write_page(
    run: StoredRun,
    comparisons: Sequence[Comparison],
    *,
    every_test: bool = False,
    on_progress: OnDrawn = ignore_progress,
) -> Path:
    """Write `report.html` of a run into its folder, replacing an earlier one when the new one is complete."""
    page = fit_page(run, comparisons, every_test=every_test, on_progress=on_progress)
    write_files(run.place, {REPORT: page.encode()})
    return run.place / REPORT


def _status_detail(fit: Fit) -> str:
    """Basis of the status."""
    if fit.status in ("interrupted", "stopped"):
        return "the best found so far"
    steps = "step" if fit.refinement_steps == 1 else "steps"
    cost = f"; {fit.status_reason}" if fit.status == "converged" and fit.status_reason else ""
    return f"after {numbers.format_fixed(fit.refinement_steps, 0)} refinement {steps}{cost}"


def _headline(fit: Fit) -> list[tuple[str, str, str]]:
    """Label, number and unit of the key figures."""
    return [
        ("Fit", numbers.format_fixed(fit.fit_percent, 2), "%" if math.isfinite(fit.fit_percent) else ""),
        ("NRMSE", numbers.significant(fit.nrmse, 3), ""),
        ("RMSE", numbers.significant(fit.rmse_n, 3), "N" if math.isfinite(fit.rmse_n) else ""),
    ]


def _plain(value: object) -> str:
    """A setting in words; of nested settings those that are set, each with its name."""
    if isinstance(value, float):
        return numbers.shortest(value, 6)
    if isinstance(value, Mapping):
        given = {
            name: entry for name, entry in value.items() if entry is not None and entry not in ({}, [], ())
        }
        if not given:
            return ", ".join(value)
        nested = any(isinstance(entry, Mapping) for entry in given.values())
        if nested and len(given) > 1 and len(set(map(_plain, given.values()))) == 1:
            return f"{_plain(next(iter(given.values())))} for each of {len(given)}"
        parts = [f"{name}{':' if nested else ''} {_plain(entry)}" for name, entry in given.items()]
        return _join_first(parts, "; " if nested else ", ")
    if isinstance(value, list | tuple):
        return _join_first(list(map(_plain, value)), ", ")
    return str(value)


def _join_first(parts: list[str], separator: str) -> str:
    """The parts in a row; of many, which `fit.json` has all, the first ones."""
    if len(parts) <= _SETTINGS_SHOWN:
        return separator.join(parts)
    return f"{separator.join(parts[:_SETTINGS_SHOWN])} and {len(parts) - _SETTINGS_SHOWN} more"


def write_figures(
    run: StoredRun, comparisons: Sequence[Comparison], *, on_progress: OnDrawn = ignore_progress
) -> tuple[str, ...]:
    """Write every figure of a run as an SVG and a PNG file into its folder; return their names without suffix."""
    drawn = run_figures(run, comparisons)
    for number, (name, draw) in enumerate(drawn.items()):
        on_progress(PageProgress(done=number, total=len(drawn), task=f"figure {name}"))
        figure = draw()
        write_files(
            run.place,
            {f"{FIGURES}/{name}.svg": svg_bytes(figure), f"{FIGURES}/{name}.png": png_bytes(figure)},
        )
    return tuple(drawn)


def run_figures(run: StoredRun, comparisons: Sequence[Comparison]) -> dict[str, Callable[[], Figure]]:
    """Functions that draw the figures of a run, by name of file; of several tests the name starts with the test's."""
    unit = figures.common_force_unit(comparisons)
    drawn: dict[str, Callable[[], Figure]] = {"convergence": partial(search_figure, run.fit)}
    for number, comparison in enumerate(comparisons, start=1):
        test = comparison.test
        stem = re.sub(r"[^A-Za-z0-9.-]+", "_", test.name).strip("._") or "test"
        prefix = "" if len(comparisons) == 1 else f"{number:02d}_{stem}_"
        drawn[f"{prefix}force_history"] = partial(figures.force_history, comparison, unit)
        drawn[f"{prefix}hysteresis_loops"] = partial(figures.hysteresis_loops, comparison, unit)
        if test.original is not None:
            drawn[f"{prefix}repair"] = partial(figures.repair_panel, test, test.original, unit)
    if run.profiles is not None:
        drawn["profiles"] = partial(profiles_figure, run.profiles)
    if run.ranking is not None:
        drawn["ranking"] = partial(ranking_figure, run.ranking)
    if run.plan is not None:
        current = run.fit.spec.current
        drawn["plan"] = partial(plan_figure, run.plan.plan, None if current is None else current.unit)
    return drawn
