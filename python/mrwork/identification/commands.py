"""Commands of tests, the laws that they determine, and the parts of tests on which models and laws are searched."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import Command, command_level
from mrwork.dampers.dependence import Dependence, LawName, dependence_of, dependences_in_order
from mrwork.dampers.spec import DamperSpec, with_other_dependences
from mrwork.errors import SettingError
from mrwork.identification.equivalent import Form, bounds_of, identifiable_form, joint_box, levels_needed
from mrwork.identification.excerpts import excerpt, middle_excerpts, varied_excerpt
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.records.damper_test import levels_among, loading_of
from mrwork.records.window import cut


@array_dataclass()
class CommandedTests:
    """Tests with their commands in the unit of a model, which its laws follow.

    `set_points`, shape (n_tests,), are constant commands, NaN of a test whose command varies. `commands`, shape
    (n_commands,), are those of all tests, lowest first; varying ones have common levels.
    """

    spec: DamperSpec
    tests: tuple[DamperTest, ...]
    set_points: Floats
    commands: Floats

    @classmethod
    def of(cls, spec: DamperSpec, tests: Sequence[DamperTest]) -> CommandedTests:
        """The tests of a model that follows a command."""
        unit, given = spec.command_unit or "A", [loading_of(test, spec).command for test in tests]
        varying = [command for command in given if isinstance(command, np.ndarray)]
        points = [command_level(each, unit) if isinstance(each, int | float) else math.nan for each in given]
        common = Command(np.concatenate(varying), unit).levels if varying else ()
        set_points = np.array(points)
        held = np.isfinite(set_points)
        set_points[held] = levels_among(set_points[held])
        return cls(
            spec=spec,
            tests=tuple(tests),
            set_points=set_points,
            commands=np.unique([*set_points[held], *common]),
        )

    @property
    def vary(self) -> bool:
        """Whether the command of a test varies."""
        return bool(np.isnan(self.set_points).any())

    @property
    def at(self) -> dict[float, tuple[DamperTest, ...]]:
        """The tests at each constant command, lowest first."""
        levels = np.unique(self.set_points[~np.isnan(self.set_points)]).tolist()
        return {level: tuple(compress(self.tests, self.set_points == level)) for level in levels}

    @property
    def has_levels(self) -> bool:
        """Whether the tests at constant commands determine the laws, or there are no others."""
        return not self.vary or len(self.at) >= levels_needed(self.spec)

    def refuse_few(self) -> None:
        """Refuse laws with more coefficients than there are commands."""
        if len(self.commands) < (needed := levels_needed(self.spec)):
            raise SettingError(
                f"the tests run at {len(self.commands)} command(s), the current laws need {needed}; "
                "add tests at other commands, or choose laws of a lower degree"
            )


def determines(spec: DamperSpec, commands: Floats, *, varies: bool) -> bool:
    """Whether tests at these commands, (n_commands,), determine every law and rate; of a rate one command `varies`."""
    return all(law.is_determined_at(commands) for law in spec.laws) and (varies or not spec.n_rates)


def are_determined(spec: DamperSpec, tests: Sequence[DamperTest]) -> bool:
    """Whether the commands of tests determine every law of a model and every rate of its driver."""
    if spec.command_unit is None:
        return True
    tested = CommandedTests.of(spec, tests)
    return determines(spec, tested.commands, varies=tested.vary)


def excerpts_of(problem: Problem) -> tuple[DamperTest, ...]:
    """The parts of the tests on which a model or its laws are searched, and their fit is examined."""
    tests = problem.objective.tests
    if problem.form.spec.command_unit is None:
        return tuple(map(excerpt, tests))
    if CommandedTests.of(problem.form.spec, tests).has_levels:
        return middle_excerpts(tests)
    return tuple(map(varied_excerpt, tests))


def excerpts_at(problem: Problem, theta: Floats) -> Objective:
    """The objective on the parts of the tests, with every sample where fewer do not resolve `theta`, (n_params,)."""
    parts = excerpts_of(problem)
    excerpts = problem.objective.on(problem.form.spec, parts)
    if np.isfinite(excerpts(theta[None])[0]):
        return excerpts
    pairs = zip(problem.objective.tests, parts, strict=True)
    whole = tuple(cut(test, start=part.time[0], end=part.time[-1] + part.dt) for test, part in pairs)
    return problem.objective.on(problem.form.spec, whole)


def dependences_at(laws: Mapping[str, LawName | Dependence], commands: Floats) -> dict[str, Dependence]:
    """The laws, polynomials without commands written by as many values at tested commands; other laws stay."""
    return {name: dependence_of(law).at_commands(commands.tolist()) for name, law in laws.items()}


def with_dependences_at(
    model: DamperSpec, laws: Mapping[str, LawName | Dependence], tests: Sequence[DamperTest]
) -> DamperSpec:
    """A model of a command with these laws, polynomials by values at the commands of the tests."""
    dependences_in_order(model.plain, laws, model.name)  # refuses a wrong word before a wrong test
    return with_other_dependences(model, dependences_at(laws, CommandedTests.of(model, tests).commands))


def form_through_values(form: Form, tests: tuple[DamperTest, ...], commands: Floats) -> Form:
    """The form with each polynomial law written by its values at tested commands; other bounds stay."""
    spec = with_other_dependences(form.spec, dependences_at(form.spec.laws_by_name, commands))
    if spec == form.spec:
        return form
    through = identifiable_form(spec, bounds_of(form.box, spec.names))
    return replace(through, box=joint_box(through, tests, commands))


def laws_to_type(plain: DamperSpec, given: Mapping[str, LawName | Dependence], commands: Floats) -> str:
    """Options that let the dampings and yield forces of a model follow these commands, beside the laws given."""
    defaults = {
        parameter.name: "linear" if parameter.unit == "N s/m" or len(commands) < 3 else "quadratic"
        for parameter in plain.parameters
        if parameter.scale == "log" and parameter.unit in ("N", "N s/m")
    }
    laws = " ".join(f"--law {name}={law}" for name, law in {**defaults, **given}.items())
    return f"--model {plain.name} {laws}"
