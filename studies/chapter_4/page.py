"""The study's report: one HTML page that needs nothing from anywhere else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from mrwork.report import Panel, panel, style, swatch, write_study_page
from studies.chapter_4.figures import (
    COLOURS,
    error_figure,
    generation_figure,
    loop_figure,
    reaching_figure,
    simulation_figure,
)
from studies.chapter_4.findings import Comparison, Trial, TrialFinding
from studies.chapter_4.search_settings import EFFICIENT, SEARCHES, ComparisonSettings, Model
from studies.chapter_4.tables import tables_of
from studies.chapter_5.damper_tests import FORCE_NOISE_N

_SYNTHETIC = (
    "Simulated: the static hysteretic model with the published current polynomials of the RD-1005-3, and "
    f"{FORCE_NOISE_N:g} N of white noise on the force. Neither model of the chapter is the truth."
)
_MEASURED = (
    "Measured at UTFSM on a small damper, not that of the thesis. Its authors averaged the force over a tenth of a "
    "period; the models are compared without averaging, which increases the error of both."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _ModelPart:
    label: str
    traces: tuple[Panel, ...]
    loops: tuple[Panel, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _SetPart:
    anchor: str
    title: str
    synthetic: bool
    about: str
    summary: tuple[Panel, ...]
    tables: tuple[Markup, ...]
    models: tuple[_ModelPart, ...]


def write_page(
    comparisons: Sequence[Comparison],
    findings: Sequence[Sequence[TrialFinding]],
    path: Path,
    *,
    settings: ComparisonSettings,
    skipped: str,
    footer: str,
) -> None:
    """Write the page of all sets."""
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        subject=f"{settings.replicates} runs of each search of each model on each test, {settings.population} "
        f"candidates, {settings.generations} generations",
        about="After M. T. Nguyen, Modelling and Control of Smart Structures Embedded with Magnetorheological "
        "Dampers, University of Technology, Sydney, 2009, chapter 4: the form of its tables 4.2 to 4.4. Its "
        "values were not at hand and are not reproduced here.",
        skipped=skipped,
        footer=footer,
        key=(
            *_key([(COLOURS[search], "line", search) for search in SEARCHES]),
            Markup("line: median over the runs, band (but for the coarse one): nine in ten"),
            *_key([(style.FAINT_INK, "dotted", "95 % error level")]),
        ),
        loop_key=_key(
            [
                (style.DATA, "point", "test"),
                (style.MODEL, "line", f"best run of the {EFFICIENT}"),
                (style.RESIDUAL, "line", "its median run"),
            ]
        ),
        sets=[
            _set_part(f"s{place}", comparison, found)
            for place, (comparison, found) in enumerate(zip(comparisons, findings, strict=True), start=1)
        ],
    )


def _set_part(anchor: str, comparison: Comparison, findings: Sequence[TrialFinding]) -> _SetPart:
    tests = comparison.tests
    models = tuple(dict.fromkeys(trial.model.label for trial in comparison.trials))
    by_label = {trial.model.label: trial.model for trial in comparison.trials}
    return _SetPart(
        anchor=anchor,
        title=tests.name[0].upper() + tests.name[1:],
        synthetic=tests.synthetic,
        about=_SYNTHETIC if tests.synthetic else _MEASURED,
        summary=tuple(
            panel(
                f"{anchor}-{kind}{place}",
                _title(label),
                draw(comparison, by_label[label]),
                f"{what}, {label}",
            )
            for kind, what, draw in (
                ("error", "Error against current", error_figure),
                ("reach", "Share of runs below the 95 % error level against simulations", reaching_figure),
            )
            for place, label in enumerate(models)
        ),
        tables=tuple(Markup(table.html()) for table in tables_of(findings, tests.name)),
        models=tuple(
            _model_part(f"{anchor}-m{place}", comparison, by_label[label])
            for place, label in enumerate(models)
        ),
    )


def _model_part(anchor: str, comparison: Comparison, model: Model) -> _ModelPart:
    trials = comparison.of(model)
    # The lowest, the middle and the highest current.
    shown = [trials[place] for place in dict.fromkeys((0, len(trials) // 2, len(trials) - 1))]
    return _ModelPart(
        label=model.label,
        traces=tuple(
            panel(
                f"{anchor}-{kind}{place}",
                _current(trial),
                draw(trial),
                f"Least error against {kind}, {model.label}, {_current(trial)}",
            )
            for kind, draw in (("generation", generation_figure), ("simulations", simulation_figure))
            for place, trial in enumerate(shown)
        ),
        loops=tuple(
            panel(
                f"{anchor}-loop{place}{'v' if over_velocity else 'x'}",
                _current(trial),
                loop_figure(trial, EFFICIENT, over_velocity=over_velocity),
                f"Force against {'velocity' if over_velocity else 'displacement'}, {model.label}, {_current(trial)}",
            )
            for over_velocity in (False, True)
            for place, trial in enumerate(shown)
        ),
    )


def _current(trial: Trial) -> str:
    return f"{trial.test.current:g} A"


def _title(label: str) -> str:
    return label[0].upper() + label[1:]


def _key(entries: Sequence[tuple[str, str, str]]) -> tuple[Markup, ...]:
    """Colour, kind of mark and meaning of each."""
    return tuple(Markup("{}{}").format(swatch(colour, kind), text) for colour, kind, text in entries)
