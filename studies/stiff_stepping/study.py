"""Explicit, linearly implicit, exponential and exact stepping of the stiffest damper, compared in error and cost.

python studies/stiff_stepping/study.py [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from mrwork.dampers import damper_models
from studies.former.command import Command, Findings, Say
from studies.stiff_stepping.accuracy import (
    TOLERANCE,
    derivative_error,
    model_errors,
    preset_error,
    scattered_errors,
)
from studies.stiff_stepping.cost import core_nanoseconds, counted, nanoseconds
from studies.stiff_stepping.steppers import TIMES

METHODS = tuple(TIMES)
GENERAL = tuple(method for method in METHODS if method != "exact_loop")
SUBSTEPS = (1, 2, 4, 6, 8, 16)
FACTORS = (0.5, 1.0, 2.0, 4.0)
SEEDS = range(1, 11)
IMPLICIT = ("ros2", "rodas3")
RATES = (3000, 1000)
EXPONENTS = (1.0, 1.5, 2.0)
DERIVATIVES = (("rk4", 8), ("ros2", 4), ("ros2", 8), ("rodas3", 4), ("rodas3", 8))


def run() -> dict[str, Any]:
    """Every figure, as nested dictionaries with text for keys."""
    costs = {
        "square": nanoseconds(METHODS, general=False),
        "general": nanoseconds(GENERAL, general=True),
    }
    steps = {
        method: {
            "square": asdict(counted(method, general=False)),
            "general": asdict(counted(method, general=True)) if method in GENERAL else None,
            "nanoseconds": {form: times.get(method) for form, times in costs.items()},
        }
        for method in METHODS
    }
    preset = {
        method: {str(substeps): preset_error(method, substeps, SEEDS) for substeps in SUBSTEPS}
        for method in METHODS
    }
    scattered = {
        method: {
            f"{factor:g}": {
                "median": float(np.median(error)),
                "within": float(np.mean(error < TOLERANCE)),
            }
            for factor, error in errors.items()
        }
        for method, errors in scattered_errors(GENERAL, FACTORS, 256).items()
    }
    models: dict[str, dict[str, Any]] = {}
    for spec in damper_models():
        if spec.n_states > 0:
            models[spec.name] = {}
            for rate in RATES:
                substeps, errors = model_errors(spec.name, IMPLICIT, 1.0 / rate, range(1, 4))
                models[spec.name][str(rate)] = {"substeps": substeps, **errors}
    derivatives = {
        f"{method} {substeps}": {f"{n:g}": derivative_error(method, substeps, n) for n in EXPONENTS}
        for method, substeps in DERIVATIVES
    }
    core = {"square": core_nanoseconds(general=False), "general": core_nanoseconds(general=True)}
    return {
        "core": core,
        "steps": steps,
        "preset": preset,
        "scattered": scattered,
        "models": models,
        "derivatives": derivatives,
    }


def tables(figures: dict[str, Any]) -> Iterator[str]:
    """The tables of the README, line by line."""
    steps, preset = figures["steps"], figures["preset"]
    yield "| step | rates and Jacobians | divisions | flops, n = 2 | any n | time, n = 2 | any n |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | ---: |"
    for method in METHODS:
        step = steps[method]
        general = step["general"]
        cells = [method, WORK[method], step["square"]["divisions"], step["square"]["flops"]]
        cells += [general["flops"] if general else "", *(_relative(steps, method, 1, form) for form in FORMS)]
        yield _row(cells)
    yield ""
    for name, own in (("rk4 here", steps["rk4"]["nanoseconds"]), ("the core's own", figures["core"])):
        yield f"A step of {name}: {own['square']:.1f} ns for n = 2, {own['general']:.1f} ns for any n."
    yield ""
    yield "| method, sub-steps | largest error | after 5 ms | flops per sample, n = 2 | any n | time, n = 2 | any n |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    for method in METHODS:
        for substeps in SUBSTEPS:
            error = preset[method][str(substeps)]
            flops = [steps[method][form]["flops"] * substeps if steps[method][form] else "" for form in FORMS]
            time = [_relative(steps, method, substeps / 8.0, form) for form in FORMS]
            yield _row(
                [f"{method} {substeps}", _percent(error["whole"]), _percent(error["late"]), *flops, *time]
            )
    yield ""
    yield "| times the core's sub-steps | " + " | ".join(f"{factor:g}" for factor in FACTORS) + " |"
    yield "| --- |" + " ---: |" * len(FACTORS)
    for method, errors in figures["scattered"].items():
        cells = []
        for factor in FACTORS:
            found = errors[f"{factor:g}"]
            time = _relative(steps, method, factor, "general")
            cells.append(f"{found['within']:.0%}, {_percent(found['median'])}, {time}")
        yield _row([method, *cells])
    yield ""
    yield "| model | " + " | ".join(f"{rate} Hz: sub-steps | rk4 | ros2 | rodas3" for rate in RATES) + " |"
    yield "| --- |" + " ---: |" * 4 * len(RATES)
    for model, rates in figures["models"].items():
        cells = [model]
        for found in rates.values():
            cells += [found["substeps"], *(_percent(found[method]) for method in ("rk4", *IMPLICIT))]
        yield _row(cells)
    yield ""
    yield "| derivatives, sub-steps | " + " | ".join(f"n = {n:g}" for n in EXPONENTS) + " |"
    yield "| --- |" + " ---: |" * len(EXPONENTS)
    for name, errors in figures["derivatives"].items():
        yield _row([name, *(_percent(error) for error in errors.values())])


FORMS = ("square", "general")
WORK = {
    "rk4": "4 rates",
    "ros2": "2 rates, 1 Jacobian",
    "ros3": "2 rates, 1 Jacobian",
    "rodas3": "3 rates, 1 Jacobian",
    "exponential": "1 rate, 1 Jacobian, e^x",
    "exact_loop": "3 loops with e^x",
}


def _relative(steps: dict[str, Any], method: str, factor: float, form: str) -> str:
    """Time of `factor` steps over one of RK4, powers taken alike."""
    own = steps[method]["nanoseconds"][form]
    return "" if own is None else f"{factor * own / steps['rk4']['nanoseconds'][form]:.2f}"


def _percent(error: float) -> str:
    return "> 100 %" if not error < 1.0 else f"{100.0 * error:.2g} %"


def _row(cells: list[Any]) -> str:
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def find(options: Namespace, say: Say) -> Findings:
    figures = run()
    return Findings(numbers=figures, text=tables(figures))


if __name__ == "__main__":
    sys.exit(Command(__file__, __doc__).run(find))
