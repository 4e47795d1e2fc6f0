"""Commands of tests, the laws that they determine, and the parts of tests on which models and laws are searched."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mrwork.base.values import Floats
from mrwork.dampers.command import command_level, levels_of_command
from mrwork.dampers.laws import CommandLaw, LawName, law_of, laws_in_order
from mrwork.dampers.spec import DamperSpec, with_changed_laws
from mrwork.errors import SettingError
from mrwork.identification.equivalent import Form, bounds_of, identifiable_form, joint_box, levels_needed
from mrwork.identification.excerpts import excerpt, middle_excerpt, varied_excerpt
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.records.damper_test import loading_of

# Samples of a cycle in the excerpts on which laws are searched: fits differ by 0.02 points from those with 400.
PER_CYCLE = 100


def excerpts_of(problem: Problem) -> tuple[DamperTest, ...]:
    """The parts of the tests on which a model or its laws are searched, and their fit is examined."""
    tests = problem.objective.tests
    if problem.form.spec.command_unit is None:
        return tuple(map(excerpt, tests))
    if has_levels(problem.form.spec, tests):
        return tuple(middle_excerpt(test, per_cycle=PER_CYCLE) for test in tests)
    return tuple(varied_excerpt(test) for test in tests)


def laws_at(laws: Mapping[str, LawName | CommandLaw], commands: Floats) -> dict[str, CommandLaw]:
    """The laws, polynomials without commands written by as many values at tested commands; other laws stay."""
    return {name: law_of(law).at_commands(commands.tolist()) for name, law in laws.items()}


def with_laws_at(
    model: DamperSpec, laws: Mapping[str, LawName | CommandLaw], tests: Sequence[DamperTest]
) -> DamperSpec:
    """A model of a command with these laws, polynomials by values at the commands of the tests."""
    laws_in_order(model.plain, laws, model.name)  # refuses a wrong word before a wrong test
    return with_changed_laws(model, laws_at(laws, tested_commands(model, tests)))


def tested_commands(spec: DamperSpec, tests: Sequence[DamperTest]) -> Floats:
    """Commands of all tests in the unit of the laws, (n_commands,), lowest first; of varying ones common levels."""
    unit = spec.command_unit or "A"
    commands = [loading_of(test, spec).command for test in tests]
    varying = [command for command in commands if isinstance(command, np.ndarray)]
    levels = [command for command in commands if not isinstance(command, np.ndarray | None)]
    if varying:
        levels += levels_of_command(np.concatenate(varying))
    return np.array(sorted({command_level(level, unit) for level in levels}))


def command_of(test: DamperTest, varying: str = "") -> object:
    """Key of a test: its constant command, else the text `varying`, or the label of the test."""
    if test.has_varying_command:
        return varying or test.label
    return tuple((unit, command_level(float(np.mean(command)), unit)) for command, unit in test.commands)


def form_through_values(form: Form, tests: tuple[DamperTest, ...], commands: Floats) -> Form:
    """The form with each polynomial law written by its values at tested commands; other bounds stay."""
    spec = with_changed_laws(form.spec, laws_at(form.spec.laws_by_name, commands))
    if spec == form.spec:
        return form
    through = identifiable_form(spec, bounds_of(form.box, spec.names))
    return replace(through, box=joint_box(through, tests, commands))


def has_levels(spec: DamperSpec, tests: Sequence[DamperTest]) -> bool:
    """Whether the tests at constant commands determine the laws, or there are no others."""
    levels = levels_of(spec, tests)
    return sum(map(len, levels.values())) == len(tests) or len(levels) >= levels_needed(spec)


def command_is_constant(test: DamperTest, spec: DamperSpec) -> bool:
    """Whether the command of a test in the unit of the model is constant."""
    return not isinstance(loading_of(test, spec).command, np.ndarray)


def levels_of(spec: DamperSpec, tests: Sequence[DamperTest]) -> dict[float, tuple[DamperTest, ...]]:
    """The tests at each constant command, lowest first."""
    unit, levels = spec.command_unit or "A", defaultdict[float, list[DamperTest]](list)
    for test in tests:
        if command_is_constant(test, spec):
            levels[command_level(float(np.asarray(loading_of(test, spec).command)), unit)].append(test)
    return {level: tuple(levels[level]) for level in sorted(levels)}


def count_levels(spec: DamperSpec, tests: Sequence[DamperTest]) -> int:
    """Number of distinct commands from which a search of these tests determines the laws."""
    if has_levels(spec, tests):
        return len(levels_of(spec, tests))
    return len(tested_commands(spec, tests))


def refuse_few_levels(spec: DamperSpec, n_levels: int) -> None:
    """Refuse laws with more coefficients than there are commands."""
    if n_levels < levels_needed(spec):
        raise SettingError(
            f"the tests run at {n_levels} command(s), the current laws need {levels_needed(spec)}; "
            "add tests at other commands, or choose laws of a lower degree"
        )


def laws_to_type(plain: DamperSpec, given: Mapping[str, LawName | CommandLaw], commands: Floats) -> str:
    """Options that let the dampings and yield forces of a model follow these commands, beside the laws given."""
    defaults = {
        parameter.name: "linear" if parameter.unit == "N s/m" or len(commands) < 3 else "quadratic"
        for parameter in plain.parameters
        if parameter.scale == "log" and parameter.unit in ("N", "N s/m")
    }
    laws = " ".join(f"--law {name}={law}" for name, law in {**defaults, **given}.items())
    return f"--model {plain.name} {laws}"
