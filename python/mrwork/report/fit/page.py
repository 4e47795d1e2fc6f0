"""The page of a fit with a section for each addition of a later verb, and the figure files of a run."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

from mrwork.base import numbers
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.remark import warnings_of
from mrwork.base.summary import list_names
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import reopen
from mrwork.plots import style
from mrwork.plots.canvas import png_bytes, svg_bytes
from mrwork.report.fit import later
from mrwork.report.fit.agreement import amplitude_section, tests_section
from mrwork.report.fit.figures import common_unit
from mrwork.report.fit.front import fit_lead
from mrwork.report.fit.parameter_sections import parameters_section
from mrwork.report.fit.residuals import residual_section
from mrwork.report.fit.search import search_section
from mrwork.report.html import Page, page_html
from mrwork.report.section import Group, Section, warning_section
from mrwork.runs.load import StoredRun, with_additions
from mrwork.store.long_call import LongCall
from mrwork.store.run_folder import FIGURES
from mrwork.store.run_writer import add_to_run
from mrwork.uncertainty.bands.prediction import Prediction, predictions_of

# Entries of a setting, and digits of a digest, that are shown.
_SETTINGS_SHOWN, _HASH_SHOWN = 12, 12


@style.drawn_in_style()
def fit_page(
    run: StoredRun,
    predictions: Sequence[Prediction],
    *,
    every_test: bool = False,
    summary: bool = False,
    on_progress: OnProgress | None = None,
) -> Page:
    """The page of a run: its front, and below it the sections on its fit and on what later verbs have added.

    Of many tests the best, the median and the worst are drawn in full, or with `every_test` all; a `summary` is the
    front alone. `predictions` are the tests of the fit.
    """
    if summary:
        return page_html(fit_lead(run, predictions))
    total = len(predictions) + 1
    done, call = itertools.count(), LongCall[None](on_progress=on_progress)

    def before(task: str) -> None:
        call.report(_drawing(next(done), total, task))

    of_tests = tests_section(run.fit, predictions, every_test=every_test, before=before)
    before("other sections of the page")
    unit = common_unit(predictions)
    sections = [
        warning_section(warnings_of(run.fit.remarks)),
        of_tests,
        parameters_section(run),
        None if run.held_out is None else later.held_out_section(run.held_out),
        None if run.bands is None else later.bands_section(run.bands, unit),
        None if run.ranking is None else later.ranking_section(run.ranking),
        None if run.profiles is None else later.profiles_section(run.profiles),
        None if run.draws is None else later.posterior_section(run.draws, run),
        amplitude_section(predictions),
        residual_section(predictions),
        None if run.plan is None else later.plan_section(run.plan),
        search_section(run.fit),
        later.absent_section(run),
        _provenance_section(run.fit, predictions),
    ]
    return page_html(fit_lead(run, predictions), sections)


def _provenance_section(fit: Fit, predictions: Sequence[Prediction]) -> Section:
    made = fit.provenance
    synthetic = {
        name
        for prediction in predictions
        if prediction.test.synthetic
        for name in (prediction.test.path, prediction.test.name)
    }
    settings = [
        (name.replace("_", " ").capitalize(), f"`{_plain(value)}`" if name == "command" else _plain(value))
        for name, value in made.settings.items()
        if value
    ]
    inputs = (
        f"{name}{' (synthetic)' if name in synthetic else ''} `{digest[:_HASH_SHOWN]}`"
        for name, digest in made.inputs.items()
    )
    facts = (
        ("Created", made.created),
        ("Model", f"`{fit.model}`"),
        ("Seed", str(made.rng)),
        ("Instruction set", made.instruction_set),
        ("Versions", ", ".join(f"{name} {version}" for name, version in made.versions.items())),
        *settings,
        ("Inputs, SHA-256", ", ".join(inputs)),
    )
    return Section(
        title="Provenance", summary=f"{made.created}, seed {made.rng}.", groups=(Group(facts=facts),)
    )


def open_run(path: str | Path) -> tuple[StoredRun, tuple[Prediction, ...]]:
    """The run folder at `place` with everything that it holds, and the tests of its fit, for a page or for figures."""
    opened = reopen(path)
    return with_additions(opened.run, opened.fit), predictions_of(opened.fit, opened.tests)


def _plain(value: object) -> str:
    """A setting in words; of nested settings those that are set, each with its name."""
    if isinstance(value, float):
        return numbers.shortest(value, 6)
    if isinstance(value, Mapping):
        entries = {
            name: entry for name, entry in value.items() if entry is not None and entry not in ({}, [], ())
        }
        if not entries:
            return ", ".join(value)
        nested = any(isinstance(entry, Mapping) for entry in entries.values())
        if nested and len(entries) > 1 and len(set(map(_plain, entries.values()))) == 1:
            return f"{_plain(next(iter(entries.values())))} for each of {len(entries)}"
        parts = [f"{name}{':' if nested else ''} {_plain(entry)}" for name, entry in entries.items()]
        # Of many, which `fit.json` has all, the first ones.
        more = len(parts) - _SETTINGS_SHOWN
        shown = ("; " if nested else ", ").join(parts[:_SETTINGS_SHOWN])
        return f"{shown} and {more} more" if more > 0 else shown
    return (
        list_names(list(map(_plain, value)), _SETTINGS_SHOWN)
        if isinstance(value, list | tuple)
        else str(value)
    )


def write_figures(path: Path, page: Page, *, on_progress: OnProgress | None = None) -> tuple[str, ...]:
    """Write every figure of a page as an SVG and a PNG file into its folder; return their names without suffix."""
    pictures, call = dict[str, bytes](), LongCall[None](on_progress=on_progress)
    for number, (name, figure) in enumerate(page.figures.items()):
        call.report(_drawing(number, len(page.figures), f"figure {name}"))
        pictures |= {f"{FIGURES}/{name}.svg": svg_bytes(figure), f"{FIGURES}/{name}.png": png_bytes(figure)}
    add_to_run(path, pictures)
    return tuple(page.figures)


def _drawing(done: int, total: int, task: str) -> Progress:
    said = f"drawing the page, {done} of {total}: {task}"
    return Progress(stage="page", said=(said,), share=done / total, numbers={"done": done, "total": total})
