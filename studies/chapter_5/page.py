"""The study's report: one HTML page that needs nothing from anywhere else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from mrwork.report import Panel, branches_figure, panel, style, swatch, write_study_page
from studies.chapter_5.current_laws import MODELS, STATIC, WITH_LAWS, Model
from studies.chapter_5.damper_tests import FORCE_NOISE_N
from studies.chapter_5.figures import FREQUENCY_COLOURS, loop_figure, parameter_figure, rms_figure
from studies.chapter_5.outcome import SetOutcome
from studies.chapter_5.tables import law_rms_table, law_table, per_current_table, rms_table
from studies.chapter_5.thickness_and_mean import STATIC_MODELS, forces, loops_table

_ABOUT = {
    "synthetic static": "Simulated: the static hysteretic model with the published current polynomials of the "
    f"RD-1005-3, and {FORCE_NOISE_N:g} N of white noise on the force. The static model is the truth here, so it cannot "
    "but look perfect: this shows what the method recovers, not which model is better.",
    "synthetic two-stage": "Simulated: a sharp Bouc-Wen and a broad Dahl element in parallel, our own numbers, and "
    f"{FORCE_NOISE_N:g} N of white noise on the force. None of the models compared is the truth.",
    "measured UTFSM": "Measured at UTFSM on a small damper of another make than the RD-1005-3. Its authors averaged "
    "the force over a tenth of a period; the models' force is averaged alike before the two are compared. Residuals "
    "repeat from sample to sample, so the standard errors are lower limits.",
    "measured UTFSM, averaging ignored": "The same tests with the averaging of the force ignored: "
    "the result of an identification without knowledge of it.",
    "measured UTFSM, not averaged": "The one of the two motions that is there as it was recorded, before its authors "
    "averaged it.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _ModelPart:
    label: str
    key: tuple[Markup, ...]
    panels: tuple[Panel, ...]
    tables: tuple[Markup, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _DamperPart:
    anchor: str
    title: str
    synthetic: bool
    about: str
    rms: tuple[Panel, ...]
    rms_tables: tuple[Markup, ...]
    loop_motion: str
    loop_note: str
    loops: tuple[Panel, ...]
    branches: tuple[Panel, ...]
    branch_tables: tuple[Markup, ...]
    models: tuple[_ModelPart, ...]
    law_rms: tuple[Markup, ...]


def write_page(outcomes: Sequence[SetOutcome], path: Path, *, skipped: str, footer: str) -> None:
    """Write the page of all sets, those of one damper together."""
    dampers = dict.fromkeys(outcome.tests.damper for outcome in outcomes)
    parts = [
        _damper_part(f"d{place}", [outcome for outcome in outcomes if outcome.tests.damper == damper])
        for place, damper in enumerate(dampers, start=1)
    ]
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        subject="Static hysteretic, polynomial-fitting and Bouc-Wen models, identified one current at a time and "
        "for all currents at once",
        about="After M. T. Nguyen, Modelling and Control of Smart Structures Embedded with Magnetorheological "
        "Dampers, University of Technology, Sydney, 2009, chapter 5: the form of its tables 5.2 and 5.3 and of "
        "its figures 5.6, 5.7 and 5.9. Its text was not at hand.",
        skipped=skipped,
        footer=footer,
        dampers=parts,
    )


def _damper_part(anchor: str, outcomes: list[SetOutcome]) -> _DamperPart:
    first = outcomes[0]
    name = first.tests.damper
    return _DamperPart(
        anchor=anchor,
        title=name[0].upper() + name[1:],
        synthetic=first.tests.synthetic,
        about=_ABOUT[name],
        rms=tuple(
            panel(
                f"{anchor}-rms{place}", outcome.tests.motion, rms_figure(outcome), "RMS error against current"
            )
            for place, outcome in enumerate(outcomes)
        ),
        rms_tables=tuple(Markup(rms_table(outcome).html()) for outcome in outcomes),
        loop_motion=first.tests.motion,
        loop_note="Points: "
        + ("synthetic" if first.tests.synthetic else "measured")
        + ". Line: the model identified at that current, one cycle.",
        loops=tuple(
            panel(
                f"{anchor}-loop{place}{'v' if over_velocity else 'x'}",
                model.label[0].upper() + model.label[1:],
                loop_figure(first, model, over_velocity=over_velocity),
                f"Force against {'velocity' if over_velocity else 'displacement'} at three currents, {model.label}",
            )
            for over_velocity in (False, True)
            for place, model in enumerate(MODELS)
            if model.label in first.each
        ),
        branches=tuple(_branch_panels(anchor, outcomes)),
        branch_tables=tuple(Markup(loops_table(outcome).html()) for outcome in outcomes),
        models=tuple(
            _model_part(f"{anchor}-m{place}", outcomes, model)
            for place, model in enumerate(WITH_LAWS)
            if model.label in first.laws
        ),
        law_rms=tuple(Markup(law_rms_table(outcome).html()) for outcome in outcomes),
    )


def _branch_panels(anchor: str, outcomes: list[SetOutcome]) -> Iterator[Panel]:
    """Thickness and mean, both motions over the velocity and the first over the displacement, a static model each."""
    for over, shown in (("velocity", outcomes), ("displacement", outcomes[:1])):
        for place, outcome in enumerate(shown):
            for number, label in enumerate(name for name in STATIC_MODELS if name in outcome.each):
                yield panel(
                    f"{anchor}-branches{place}{number}{over[0]}",
                    f"{outcome.tests.motion}, {label}, over {over}",
                    branches_figure(outcome.tests.tests, forces(outcome, outcome.each[label]), over=over),
                    f"Thickness and mean of the loops against {over}, {outcome.tests.motion}, {label}",
                )


def _model_part(anchor: str, outcomes: list[SetOutcome], model: Model) -> _ModelPart:
    return _ModelPart(
        label=model.label,
        key=_key(outcomes, model),
        panels=tuple(
            panel(
                f"{anchor}-{name}", name, parameter_figure(outcomes, model, name), f"{name} against current"
            )
            for name in model.free
        ),
        tables=tuple(
            Markup(table.html())
            for outcome in outcomes
            for table in (
                per_current_table(outcome, outcome.each[model.label]),
                law_table(outcome, outcome.each[model.label]),
            )
        ),
    )


def _key(outcomes: list[SetOutcome], model: Model) -> tuple[Markup, ...]:
    """Meaning of the marks in a parameter's panel."""
    lines = [
        Markup('{}<span style="color:{}">{}</span>').format(
            swatch(colour, "point"), colour, outcome.tests.motion
        )
        for outcome, colour in zip(outcomes, FREQUENCY_COLOURS, strict=False)
    ]
    lines += [
        Markup("points: at each current, bars of one standard error; hollow: no standard error"),
        Markup("{}polynomial through them").format(swatch(style.INK, "line")),
        Markup("{}law identified jointly").format(swatch(style.INK, "dashed")),
    ]
    if model == STATIC and outcomes[0].true_laws is not None:
        lines.append(Markup("{}truth, published").format(swatch(style.RULE, "wide")))
    return tuple(lines)
