"""The dossier of an identification as one HTML page that needs nothing from anywhere else."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from mrwork.identification.fit import Fit
from mrwork.records.damper_test import DamperTest, Finding
from mrwork.report import figures, font, numbers, style, tables
from mrwork.report.comparison import Comparison
from mrwork.report.cycles import zoom_window
from mrwork.report.fit.section import Absent, Panel, Section, panel
from mrwork.report.fit.waterfall import descents_in_words, waterfall_panel
from mrwork.report.panels import POINTS_IN_LOOP, POINTS_IN_WINDOW
from mrwork.report.style import DisplayUnit
from mrwork.report.typeset import breakable, coded, equation_html, symbol

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
    "not_converged": "The search stopped before it converged. The parameters below may still improve.",
}
_HASH_SHOWN = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class TestBlock:
    """Everything the page shows of one test."""

    anchor: str
    name: str
    synthetic: bool
    conditions: str
    agreement: tables.AgreementRow
    findings: tuple[Finding, ...]
    panels: tuple[Panel, ...]


def identification_report(
    fit: Fit,
    comparisons: Sequence[Comparison],
    *,
    model_title: str,
    equation: str,
    source: str,
    sections: Sequence[Section] = (),
    absent: Sequence[Absent] = (),
) -> str:
    """The page of a fit and of the tests it is compared with.

    Parameters
    ----------
    fit
        What was identified.
    comparisons
        The tests, each with the model's force, in the order in which they appear.
    model_title, equation, source
        The model's name for people, its equations in plain letters (`k_w`, `rho`, `|w|^(n-1)`; a few simple
        tags pass through) and where they were published.
    sections
        What stands between the fit and its provenance.
    absent
        Sections that the run does not have yet.

    Returns
    -------
    str
        HTML with styles and figures inside.
    """
    *agreement, overall = tables.agreement_rows(fit, comparisons)
    unit = figures.common_force_unit(comparisons)
    synthetic = {
        name
        for comparison in comparisons
        if comparison.test.synthetic
        for name in (comparison.test.path, comparison.test.name)
    }
    template = environment().from_string(resource("fit.html.j2"))
    return template.render(
        styles=Markup(styles()),
        fit=fit,
        model_title=model_title,
        equation=Markup(equation_html(equation)),
        source=source,
        status=_STATUS[fit.status],
        status_detail=_status_detail(fit),
        banner=_BANNER.get(fit.status, ""),
        headline=_headline(fit),
        tests=[(comparison.test.name, comparison.test.synthetic) for comparison in comparisons],
        parameters=tables.parameter_rows(fit.estimates),
        caution=tables.caution(fit),
        overall=overall,
        blocks=[
            _test_block(number, comparison, row, unit)
            for number, (comparison, row) in enumerate(zip(comparisons, agreement, strict=True), start=1)
        ],
        searched=tuple(filter(None, (_convergence_panel(fit), waterfall_panel(fit)))),
        search=_search_facts(fit),
        sections=sections,
        checked=tables.checked(comparisons),
        absent=absent,
        settings=[(name, _plain(value)) for name, value in fit.provenance.settings.items() if value],
        inputs=[
            (name, digest, digest[:_HASH_SHOWN], name in synthetic)
            for name, digest in fit.provenance.inputs.items()
        ],
    )


# Why a search ended, in words.
_ENDED = {
    "found_again": "once enough descents had reached the best minimum",
    "max_rounds": "at the limit of descents",
    "hypothesis_test": "by the hypothesis test on its decay",
    "stall": "when the best no longer improved",
    "spread": "when the population had drawn together",
    "max_generations": "at the limit of generations",
    "max_evaluations": "at the limit of simulations",
    "max_seconds": "at the limit of time",
    "target": "at the misfit wanted",
    "callback": "on request",
    "interrupted": "by an interrupt",
}


def _status_detail(fit: Fit) -> str:
    """What the status rests on."""
    if fit.status in ("interrupted", "stopped"):
        return "the best found so far"
    steps = "step" if fit.refinement_steps == 1 else "steps"
    return f"after {numbers.fixed(fit.refinement_steps, 0)} refinement {steps}"


def _headline(fit: Fit) -> list[tuple[str, str, str]]:
    """Label, number and unit of the figures that everyone looks for first."""
    return [
        ("Fit", numbers.fixed(fit.fit_percent, 2), "%" if math.isfinite(fit.fit_percent) else ""),
        ("NRMSE", numbers.significant(fit.nrmse, 3), ""),
        ("RMSE", numbers.significant(fit.rmse_n, 3), "N" if math.isfinite(fit.rmse_n) else ""),
    ]


def _search_facts(fit: Fit) -> list[tuple[str, str]]:
    return [
        ("Descents", descents_in_words(fit)),
        ("Search ended", _ENDED.get(fit.trace.stop_reason, fit.trace.stop_reason)),
        ("Generations or iterations", numbers.fixed(len(fit.trace.evaluations), 0)),
        ("Simulated candidates", numbers.fixed(fit.evaluations, 0)),
        ("Refinement steps", numbers.fixed(fit.refinement_steps, 0)),
        ("Samples compared", numbers.fixed(fit.n_time, 0)),
        ("Duration", f"{numbers.significant(fit.seconds, 3)} s"),
    ]


def _test_block(
    number: int, comparison: Comparison, agreement: tables.AgreementRow, unit: DisplayUnit
) -> TestBlock:
    test = comparison.test
    return TestBlock(
        anchor=f"test-{number}",
        name=test.name,
        synthetic=test.synthetic,
        conditions=tables.conditions(test, comparison.quality),
        agreement=agreement,
        findings=tuple(sorted(test.findings, key=lambda finding: finding.severity != "warning")),
        panels=_test_panels(f"t{number}", comparison, agreement, unit),
    )


def _test_panels(
    identifier: str, comparison: Comparison, agreement: tables.AgreementRow, unit: DisplayUnit
) -> tuple[Panel, ...]:
    test, data = comparison.test, comparison.data_label
    agrees = (
        f"for test {test.name}: {data} and model, fit {agreement.fit_percent} %, RMSE {agreement.rmse_n} N"
    )
    window = zoom_window(test.displacement)
    in_window = _thinning(window.stop - window.start, POINTS_IN_WINDOW)
    in_loop = _thinning(test.n_time, POINTS_IN_LOOP)

    def of(suffix: str, title: str, figure: Figure, what: str, note: str) -> Panel:
        return panel(f"{identifier}-{suffix}", title, figure, f"{what} {agrees}", note)

    panels = (
        of(
            "record",
            "Whole record",
            figures.record_panel(comparison, unit),
            "Force against time over the whole record, with the residual below,",
            f"Residual: {data} minus model. The shaded part is enlarged in the next figure.",
        ),
        of(
            "cycles",
            _window_title(comparison),
            figures.cycles_panel(comparison, unit),
            "Force against time over a few cycles, with the residual below,",
            in_window,
        ),
        of(
            "displacement",
            "Force against displacement",
            figures.displacement_loop(comparison, unit),
            "Force against displacement",
            in_loop,
        ),
        of(
            "velocity",
            "Force against velocity",
            figures.velocity_loop(comparison, unit),
            "Force against velocity",
            in_loop,
        ),
    )
    return (
        panels if test.original is None else (*panels, _repair_panel(identifier, test, test.original, unit))
    )


def _repair_panel(identifier: str, test: DamperTest, original: DamperTest, unit: DisplayUnit) -> Panel:
    return panel(
        f"{identifier}-repair",
        "Before and after repair",
        figures.repair_panel(test, original, unit),
        f"Force against displacement of test {test.name}, as it came and repaired",
        "What was repaired stands among the findings; the model was compared with the repaired record.",
    )


def _window_title(comparison: Comparison) -> str:
    window = zoom_window(comparison.test.displacement)
    if window.first_cycle is None:
        return "Middle of the record"
    if window.n_cycles == 1:
        return f"Cycle {window.first_cycle}"
    return f"Cycles {window.first_cycle} to {window.first_cycle + window.n_cycles - 1}"


def _thinning(n_time: int, drawn: int) -> str:
    if n_time <= drawn:
        return ""
    return f"About {drawn} of {numbers.fixed(n_time, 0)} samples are drawn; the model line is whole."


def _convergence_panel(fit: Fit) -> Panel:
    reached = "refined to" if fit.refinement_steps else "best fit"
    description = (
        f"NRMSE of the best and of the median candidate against simulated candidates, "
        f"{len(fit.trace.evaluations)} generations or iterations, {reached} {numbers.significant(fit.nrmse, 3)}"
    )
    return panel("search", "Misfit during the search", figures.search_figure(fit), description)


def _plain(value: object) -> str:
    """A setting as a person would write it."""
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return numbers.shortest(value, 6)
    return json.dumps(value, ensure_ascii=False, default=str)


def styles() -> str:
    """The style sheet of every page."""
    colours = {
        "ink": style.INK,
        "faint-ink": style.FAINT_INK,
        "rule": style.RULE,
        "accent": style.MODEL,
        "alert": style.RESIDUAL,
        "panel": style.WINDOW,
        "fonts": ", ".join(f'"{name}"' for name in style.PAGE_FONTS) + ", sans-serif",
    }
    variables = "".join(f"--{name}: {value};" for name, value in colours.items())
    return f"{font.font_faces()}:root {{{variables}}}\n{resource('report.css')}"


def resource(name: str) -> str:
    """A template or style sheet as it lies in the package."""
    return (files("mrwork.report") / "templates" / name).read_text(encoding="utf-8")


def environment() -> Environment:
    """How every page is filled in: all is escaped, and a name without content is an error."""
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(resource),
    )
    environment.filters["breakable"] = lambda name: Markup(breakable(name))
    environment.filters["coded"] = lambda sentence: Markup(coded(sentence))
    environment.filters["symbol"] = lambda name: Markup(symbol(name))
    return environment
