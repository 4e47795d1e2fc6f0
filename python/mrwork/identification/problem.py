"""The problem of an identification, its fingerprint and provenance, and starting values from earlier fits."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mrwork import _rust
from mrwork.base.arguments import checked
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.dampers.command import command_level
from mrwork.dampers.conversions import Conversion
from mrwork.dampers.coordinates import Box
from mrwork.dampers.dependence import Dependence
from mrwork.dampers.parameters import DRIVER_RATES, RATE_NAMES, ParamSpec
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError, UnknownNameError
from mrwork.identification.equivalent import Form, identifiable_form
from mrwork.identification.fit import Fit, Provenance
from mrwork.identification.indistinct import (
    bounds_without_offsets,
    open_size,
    refuse_indistinct,
    unlike_offsets,
)
from mrwork.identification.objective import Objective, ties_of
from mrwork.identification.settings import FitSettings, Race, Start
from mrwork.records import DamperTest, observed
from mrwork.records.observation import Effect
from mrwork.records.read import ROTARY
from mrwork.search import Optimiser
from mrwork.store.codec import digest_of, package_version
from mrwork.store.journal import Journal


def are_rotary(tests: Iterable[DamperTest]) -> bool:
    """Whether one of several tests is of angle and torque."""
    return any(remark.code == ROTARY.code for test in tests for remark in test.remarks)


_PACKAGES = ("mrwork", "numpy", "scipy", "jax", "optimistix")

# Commands between its values at which a saturating law starts near an earlier one.
_COMPARED = 21
_POOLED = RemarkKind(
    "commands_pooled",
    "{observation} but no parameter of {0} follows the command: the fit is a compromise between them, right at none",
    "let parameters follow the command with --law auto or --law NAME=LAW (in Python `with_current_laws`), or give "
    "tests at one command",
)
_COMMAND_IGNORED = RemarkKind(
    "command_ignored",
    "the command varies in {1}, and no parameter of this {0} follows it: the predicted force is that of one command",
    "identify it with --law NAME=LAW (in Python `with_current_laws`)",
)
_RATE_HIDDEN = RemarkKind(
    "lag_rate_hidden",
    "the command is constant in every test, so nothing shows the rate eta of the driver's lag",
    "add a test with a command that varies, fix it with --fix eta=VALUE, or leave the lag out",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A model `spec` with the settings of its identification, and the objective on the tests.

    `form` is the equivalent model that is searched, see `identifiable_form`; the `objective` is of that form. The
    settings are complete: they include the search, and bounds that fix offsets which those of each test replace.
    """

    spec: DamperSpec
    settings: FitSettings
    form: Form
    objective: Objective

    @classmethod
    def of(
        cls,
        spec: DamperSpec,
        tests: tuple[DamperTest, ...],
        settings: FitSettings,
        *,
        threads: int = 0,
        journal: Journal | None = None,
    ) -> Problem:
        """Complete the settings, check them against the model and the tests, and prepare the simulation."""
        settings = replace(
            settings,
            search=settings.search or Race(),
            bounds=bounds_without_offsets(settings.observing, spec) | dict(settings.bounds),
        )
        refuse_indistinct(settings.observing, tests)
        if are_rotary(tests) and not all(are_rotary((test,)) for test in tests):
            raise SettingError("some tests are of angle and torque and others of a stroke; fit them apart")
        form = identifiable_form(spec, settings.bounds)
        _check_starts(spec, form, settings.starts)
        form = tied_form(form, spec, settings)
        objective = Objective.of(
            form.spec,
            tuple(observed(test, settings.observing) for test in tests),
            settings,
            threads=threads,
            journal=journal,
        )
        if not form.box.free:
            raise SettingError(f"every parameter of {spec.name} is fixed; leave at least one free")
        return cls(spec=spec, settings=settings, form=form, objective=objective)

    @classmethod
    def of_fit(cls, fit: Fit, tests: tuple[DamperTest, ...], *, threads: int = 0) -> Problem:
        """The problem that a fit solved, on its own tests or others of the same damper."""
        return cls.of(fit.spec, tests, fit.settings, threads=threads)

    def freeing(self, effects: Iterable[Effect]) -> Problem:
        """The problem in which fitted effects are free again: the last parameters of its form and of its model."""
        if not (free := tuple(effects)):
            return self
        objective, form = with_free(self.objective, self.form, free)
        return replace(self, objective=objective, form=form)

    def foreseen(self) -> Iterator[Remark]:
        """Why any result is likely to mislead, known before the search."""
        tests, settings = self.objective.tests, self.settings
        yield from pooled_commands(tests, (self.spec,))
        if self.shows_rate is False:
            yield _RATE_HIDDEN.remark()
        yield from open_size(settings.observing)
        yield from unlike_offsets(settings.observing, self.spec, settings.bounds, tests)

    @property
    def shows_rate(self) -> bool | None:
        """Whether a command that varies shows the rates of the driver's lag; `None` where none is estimated."""
        box = self.form.box
        if not any(box.names.index(rate.name) in box.free for rate in DRIVER_RATES[self.spec.lag]):
            return None
        return any(test.has_varying_command for test in self.objective.tests)

    @property
    def search(self) -> Race | Optimiser:
        """The search, which complete settings always have."""
        search = self.settings.search
        assert not isinstance(search, str | None)
        return search

    def inside(self, theta: ArrayLike) -> Floats:
        """Parameters of the requested model, (n_params,), converted to the form and moved inside its box."""
        return np.asarray(self.form.box.inside(self.form.from_model(np.asarray(theta, dtype=np.float64))))


def with_free(objective: Objective, form: Form, effects: tuple[Effect, ...]) -> tuple[Objective, Form]:
    """Objective and form with free effects as last parameters, of the form as of the model."""

    def beside(conversion: Conversion) -> Conversion:
        n_last = len(effects)
        return Conversion(
            lambda theta: np.concatenate([conversion(theta[..., :-n_last]), theta[..., -n_last:]], axis=-1)
        )

    compared = tuple(replace(test, free=effects) for test in objective.compared)
    box = box_with_free(form.box, effects)
    form = replace(form, box=box, to_model=beside(form.to_model), from_model=beside(form.from_model))
    return replace(objective, compared=compared), form


def box_with_free(box: Box, effects: tuple[Effect, ...]) -> Box:
    """The box with the ranges of free effects, which are its last parameters."""
    ranges = [effect.free or (-np.inf, np.inf) for effect in effects]
    return Box(
        names=(*box.names, *(effect.parameter for effect in effects)),
        lower=(*box.lower, *(lower for lower, _ in ranges)),
        upper=(*box.upper, *(upper for _, upper in ranges)),
        log=(*box.log, *(False for _ in effects)),
    )


def tied_form(form: Form, spec: DamperSpec, settings: FitSettings) -> Form:
    """The form in which the tied parameters do not vary, and follow in the parameters of the model."""
    if not settings.ties:
        return form
    if spec.command_unit is not None:
        raise SettingError(
            f"the parameters of {spec.name} follow the command, and ties are between constant parameters; leave out "
            "the laws or the ties"
        )
    if form.spec.name != spec.name:
        raise SettingError(
            f"{spec.name} is identified as {form.spec.name}, since the data do not settle all of its parameters; tie "
            f"those of {form.spec.name}"
        )
    ties = ties_of(spec, settings)
    assert ties is not None
    # Values that nothing depends on.
    somewhere = np.clip(spec.nominal, form.box.lower, form.box.upper)
    held = {spec.names[index]: (float(somewhere[index]),) * 2 for index in ties.indices}
    return replace(
        form,
        box=form.box.with_bounds(held),
        to_model=ties.conversion,
        mirrored=() if set(form.mirrored) & set(ties.indices) else form.mirrored,
    )


def provenance_of(problem: Problem) -> Provenance:
    """Versions, inputs by hash, and settings of an identification."""
    tests = problem.objective.tests
    record = problem.settings.as_record()
    # The seed is a field of its own.
    return provenance_with(
        {name: value for name, value in record.items() if name != "rng"}
        | {
            "windows": {
                test.label: {
                    "start": test.start_time,
                    "dt": test.dt,
                    "n_time": test.n_time,
                    "n_settle": test.n_settle,
                }
                for test in tests
            }
        },
        tests,
        packages=_PACKAGES,
        rng=problem.settings.rng,
    )


def provenance_with(
    settings: dict[str, Any], tests: Sequence[DamperTest], *, packages: Sequence[str], rng: int
) -> Provenance:
    """Provenance of a result of these settings, with the versions of the packages that compute it."""
    return Provenance(
        versions={"python": platform.python_version()} | {name: package_version(name) for name in packages},
        instruction_set=_rust.instruction_set(),
        inputs={test.label: test.sha256 for test in tests},
        settings=settings,
        rng=rng,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def problem_fingerprint(problem: Problem) -> dict[str, object]:
    """All inputs that determine the result bit for bit; a journal can be resumed only with the same fingerprint."""
    settings, laws = problem.settings.as_record(), problem.spec.current_laws
    return {
        "model": problem.spec.name,
        **({} if problem.spec.own is None else {"equations": problem.spec.own.digest}),
        "current_laws": None if laws is None else asdict(laws),
        "seed": settings.pop("rng"),
        # The order of the bounds has no effect on the result.
        "bounds": dict(sorted(settings.pop("bounds").items())),
        **settings,
        "test": [
            {
                "name": test.name,
                "sha256": test.sha256,
                "samples": test.n_time,
                "settle_samples": test.n_settle,
                "commands": [
                    [digest_of(value) if isinstance(value, np.ndarray) else value, unit]
                    for value, unit in test.commands
                ],
                "observation": test.observation.in_words,
                # Changes with windows, repairs and units of columns.
                "signals": digest_of(test.dt, test.displacement, test.velocity, test.force, test.observation),
            }
            | ({"uncompared": test.uncompared} if test.uncompared else {})
            for test in problem.objective.tests
        ],
        "version": {name: package_version(name) for name in _PACKAGES},
    }


def pooled_commands(tests: Sequence[DamperTest], specs: Sequence[DamperSpec]) -> Iterator[Remark]:
    """Warn where models with constant parameters are to describe several commands."""
    commands = [test.commands[0] for test in tests if test.commands]
    levels = sorted(
        {(unit, command_level(value, unit)) for value, unit in commands if not isinstance(value, np.ndarray)}
    )
    varying = {command.in_words for command in commands if command.varies}
    constant = [spec.name for spec in specs if spec.command_unit is None]
    if not constant or len(levels) + 2 * len(varying) < 2:
        return
    listing = [
        f"{', '.join(f'{level:g}' for level_unit, level in levels if level_unit == unit)} {unit}"
        for unit in dict.fromkeys(unit for unit, _ in levels)
    ]
    if varying:
        observation = f"the command varies during tests ({'; '.join([*listing, *sorted(varying)])})"
    else:
        observation = f"the tests are at {len(levels)} commands ({', '.join(listing)})"
    yield _POOLED.remark(list_names(constant), observation=observation)


def ignored_commands(spec: DamperSpec, tests: Sequence[DamperTest]) -> Iterator[Remark]:
    """Warn where a model with constant parameters is to predict a command that varies."""
    varying = [test.label for test in tests if test.has_varying_command]
    if varying and not spec.follows_command:
        yield _COMMAND_IGNORED.remark(spec.name, list_names(varying))


@checked
def start_from(fit: Fit, model: DamperSpec) -> dict[str, float]:
    """Start of a model from an earlier fit: values of the parameters with the same name and unit in both models.

    A law may be the same or of a higher degree; the additional coefficients then start at values without effect. A law
    by values starts on the curve of any earlier one.

    Raises
    ------
    SettingError
        Where no parameter is shared, a law cannot be transferred, or the laws depend on another kind of command.
    """
    earlier = fit.spec
    plain, earlier_plain = model.without_laws, earlier.without_laws
    units = {parameter.name: parameter.unit for parameter in earlier_plain.parameters}
    units_of_command = model.command_unit, earlier.command_unit
    if None not in units_of_command and model.command_unit != earlier.command_unit:
        raise SettingError(
            f"the laws of the earlier fit take {earlier.command_unit}, those of {model.name} "
            f"{model.command_unit}; start from a fit in {model.command_unit}"
        )
    values = dict(zip(earlier.names, fit.theta, strict=True))
    laws, earlier_laws = model.laws_by_name, earlier.laws_by_name
    start: dict[str, float] = {}
    for name in (
        parameter.name for parameter in plain.parameters if units.get(parameter.name) == parameter.unit
    ):
        parameters = [parameter for parameter in model.parameters if parameter.plain_name == name]
        old = [values[parameter.name] for parameter in earlier.parameters if parameter.plain_name == name]
        start |= _transfer_law(parameters, laws[name], np.array(old), earlier_laws[name])
    if not start:
        raise SettingError(
            f"{model.name} shares no parameter with {earlier.name}; start from a model with some of "
            f"{', '.join(plain.names)}"
        )
    return start | {name: values[name] for name in RATE_NAMES & {*model.names} & {*values}}


def _transfer_law(
    parameters: Sequence[ParamSpec], law: Dependence, values: Floats, earlier: Dependence
) -> dict[str, float]:
    """Start of the coefficients, `parameters`, of a law from the values of an earlier law of the same parameter."""
    names = [parameter.name for parameter in parameters]
    if law.saturates and law != earlier:
        between = np.linspace(law.nodes[0], law.nodes[-1], _COMPARED)
        nearest = law.through(parameters[0], between, earlier.values(values, between))
        return dict(zip(names, nearest, strict=True))
    if law.nodes and law != earlier:
        at_nodes = earlier.values(values, np.array(law.nodes))
        return dict(zip(names, at_nodes.tolist(), strict=True))
    if law != earlier and not earlier.is_special_case_of(law):
        raise SettingError(
            f"{parameters[0].plain_name} is {earlier} in the earlier fit and {law} now; "
            "a start can keep a law or raise its degree"
        )
    nominal = [parameter.nominal for parameter in parameters]
    return dict(zip(names, [*values.tolist(), *nominal[len(values) :]], strict=True))


def _check_starts(spec: DamperSpec, form: Form, starts: Sequence[Start]) -> None:
    for start in starts:
        for name, value in start.items():
            if name not in spec.names:
                raise UnknownNameError(
                    f"a start names {name!r}, which {spec.name} does not have; it has {', '.join(spec.names)}"
                )
            if not isfinite(value):
                raise SettingError(f"a start gives {name} the value {value}; a finite number is expected")
        missing = [name for name in spec.names if name not in start]
        if missing and form.spec.name != spec.name:
            raise SettingError(
                f"{spec.name} is identified as {form.spec.name}, which takes a start only as a whole; "
                f"give {', '.join(missing)} too"
            )
