"""The result of an identification: parameters and how certain they are, quality of the fit, provenance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, ClassVar, Literal, TypeVar

from mrwork.base.arguments import Count, Level, NotNegative, Positive, Samples, Whole, checked
from mrwork.base.keys import suggestion
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, columns_of, labels_of, number_labels
from mrwork.base.numbers import format_rounded, in_plain, of_unit, value_and_error
from mrwork.base.plotted import Plots
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.parameters import CurrentLaws
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.dampers.tested_range import outside_of
from mrwork.errors import UnknownNameError
from mrwork.identification.residual import NONE, Nuisance, NuisanceName
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, Observation, observed
from mrwork.records.damper_test import AS_IT_IS, OperatingRange, Outside, range_of_test
from mrwork.records.likeness import Likeness, RecordedMotion, likest_of_other_force, likest_of_same_force
from mrwork.records.reading import Reading
from mrwork.search.rules import ended_in_words
from mrwork.store.codec import digest_of

T = TypeVar("T")

# Decided in `uncertainty/identifiability/verdicts.py` alone, and read from `Fit.verdict_on`.
VerdictName = Literal["identifiable", "weakly identifiable", "sign unknown", "negligible", "not identifiable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Interval of one parameter in its unit; an end that the data do not bound is `None`.

    `verdict` is `None` for a parameter of the noise.
    """

    name: str
    lower: float | None
    upper: float | None
    verdict: VerdictName | None
    reason: str

    def in_words(self, shown: Callable[[float], str]) -> str:
        """Text such as "6317 to 7278", or "above 835.8" where one end is open; `shown` formats a number."""
        if self.lower is None:
            return "open" if self.upper is None else f"below {shown(self.upper)}"
        if self.upper is None:
            return f"above {shown(self.lower)}"
        return f"{shown(self.lower)} to {shown(self.upper)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """Intervals of all free parameters of a fit at one `level`, by profile likelihood or from posterior draws."""

    kind: Literal["profile", "posterior"]
    level: Level
    intervals: tuple[Interval, ...]

    @property
    def heading(self) -> str:
        """Heading of the column of intervals."""
        return f"{100.0 * self.level:g} % {self.kind} interval"

    def of(self, name: str) -> Interval | None:
        """The interval of a parameter; `None` where it was not free."""
        return next((interval for interval in self.intervals if interval.name == name), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Identifiability of one parameter, with the reason.

    `standard_error` is in the parameter's unit, for the effective number of samples; `None` where there is none.
    """

    name: str
    verdict: VerdictName
    standard_error: NotNegative | None
    reason: str

    def by_interval(self, interval: Interval | None) -> Verdict:
        """The verdict by the interval if it has one, else this verdict."""
        if interval is None or interval.verdict is None:
            return self
        return replace(self, verdict=interval.verdict, reason=interval.reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterChange:
    """Component of a direction along one parameter: percent of its value, or of its range where `of_range`."""

    name: str
    percent: float
    of_range: bool
    amount: float
    unit: str

    @property
    def in_words(self) -> str:
        """Text such as "alpha up 1 %", or "x0 down 0.0002 m" where the value may be zero."""
        way = "up" if self.percent > 0 else "down"
        if self.of_range:
            return f"{self.name} {way} {of_unit(abs(self.amount), self.unit, 2)}"
        return f"{self.name} {way} {abs(self.percent):.2g} %"


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """A combined change of parameters that has little effect on the residuals, or none where `seen` is false.

    `effect` is the root mean square of the resulting change of force, per standard deviation of the force.
    """

    changes: tuple[ParameterChange, ...]
    effect: NotNegative
    seen: bool
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Identifiability(Summarised):
    """A verdict for each free parameter, and the directions that the data determine weakly or not at all.

    `n_effective` is the effective number of samples; it is below `n_time` where residuals are correlated. In a fit with
    intervals the `verdicts` are by these, and `by_derivatives` keeps those that they replaced.
    """

    verdicts: tuple[Verdict, ...]
    directions: tuple[Direction, ...]
    n_time: Count
    n_effective: Positive
    by_derivatives: tuple[Verdict, ...] = ()

    def with_intervals(self, intervals: Intervals | None) -> Identifiability:
        """Identifiability with the verdicts of the intervals, or of the derivatives where there is no interval."""
        own = self.by_derivatives or self.verdicts
        if intervals is None:
            return replace(self, verdicts=own, by_derivatives=())
        return replace(
            self,
            verdicts=tuple(verdict.by_interval(intervals.of(verdict.name)) for verdict in own),
            by_derivatives=own,
        )

    def verdict_on(self, name: str) -> Verdict | None:
        """The verdict on a parameter; `None` where it was not free."""
        return next((verdict for verdict in self.verdicts if verdict.name == name), None)

    @property
    def informative(self) -> tuple[Direction, ...]:
        """The directions without those dominated by an identifiable or negligible parameter."""
        harmless = ("identifiable", "negligible")
        settled = {verdict.name for verdict in self.verdicts if verdict.verdict in harmless}
        return tuple(way for way in self.directions if not way.seen or way.changes[0].name not in settled)

    def _summary(self) -> Summary:
        return Summary(
            title=f"Identifiability from {self.n_time} samples, {self.n_effective:.0f} effective samples",
            columns=("parameter", "standard error [SI]", "verdict", "reason"),
            rows=[
                (verdict.name, format_rounded(verdict.standard_error, 2), verdict.verdict, verdict.reason)
                for verdict in self.verdicts
            ],
            notes=[direction.sentence for direction in self.informative],
        )


# Key of the record of settings that the command line adds to those of `FitSettings`.
_READING = "reading"
# Share by which a value may exceed its bound after a conversion between forms of a model.
_ROUNDING = 1e-6

NEGLIGIBLE = 0.1
"""Negligible difference in fit [percentage points]: the cycles of a real test repeat to 97-99 %."""

FitStatus = Literal["converged", "not_converged", "interrupted", "stopped"]
Remark = Literal["", "fixed", "at lower bound", "at upper bound", "not identifiable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One parameter of a fit, in SI.

    `standard_error` follows from the Jacobian and counts `Fit.n_effective` samples, fewer than there are where
    residuals are correlated. It is `None` where the parameter is not identifiable by the derivatives, was fixed, or is
    on a bound. The verdict on a parameter is that of `Fit.verdict_on`.
    """

    _made_by: ClassVar[str] = "fit.estimates"

    name: str
    unit: str
    value: float
    standard_error: NotNegative | None
    lower: float
    upper: float
    remark: Remark = ""

    def judge(self, verdict: Verdict | None) -> Estimate:
        """The estimate with the standard error that belongs to its verdict; unchanged without a verdict."""
        if verdict is None:
            return self
        undetermined = verdict.verdict == "not identifiable"
        kept = "" if self.remark == "not identifiable" else self.remark
        return replace(
            self, standard_error=verdict.standard_error, remark="not identifiable" if undetermined else kept
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedParameter:
    """One parameter of a fit, in SI, as a script asks for it.

    `error` is the standard error, `None` where there is none, see `Estimate`; `verdict` and `reason` are those of
    `Fit.verdict_on`. `tie` is the expression that the parameter is tied to, empty where it is not.
    """

    _made_by: ClassVar[str] = "fit.parameters"

    name: str
    value: float
    error: float | None
    unit: str
    lower: float
    upper: float
    verdict: str
    reason: str = ""
    tie: str = ""


class _ByParameter(dict[str, T]):
    """Values by parameter name; an unknown name is refused with the similar ones."""

    def __init__(self, model: str, values: Mapping[str, T]) -> None:
        super().__init__(values)
        self.model = model

    def __missing__(self, name: str) -> T:
        raise UnknownNameError(
            f"{self.model} has no parameter {name!r}{suggestion(name, [*self], otherwise='it has')}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorNorms:
    """Normalised errors over time, displacement and velocity (Spencer et al. 1997)."""

    time: NotNegative
    displacement: NotNegative
    velocity: NotNegative


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FitQuality(Summarised):
    """Error of a free-run simulation on one measured test, over the `n_time` samples that count.

    The first `settle_seconds` are simulated but not compared, see `DamperTest`. The `observation` model and the
    `nuisance` parameters were applied to the simulated force before the comparison.
    """

    _made_by: ClassVar[str] = "fit.quality"

    _units: ClassVar[Mapping[str, str]] = {"fit_percent": "%", "rmse_n": "N", "settle_seconds": "s"}

    test: str
    fit_percent: float
    nrmse: NotNegative
    rmse_n: NotNegative
    error_norms: ErrorNorms
    residual_autocorrelation: float
    n_time: Count
    settle_seconds: NotNegative
    substeps: Count
    observation: Observation = AS_IT_IS
    nuisance: Nuisance = NONE

    @property
    def recorded_in_words(self) -> str:
        """What was applied to the model's force before the comparison, as a participle; empty for nothing."""
        return ", ".join(filter(None, (self.observation.in_words, self.nuisance.in_words)))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SearchTrace(Summarised):
    """One entry per generation: simulations so far, least and median misfit (NRMSE) of the population.

    For `Multistart` an entry is one iteration of all running local minimisations; `ends` are the final misfits, sorted.
    """

    _made_by: ClassVar[str] = "fit.trace"

    evaluations: tuple[Whole, ...]
    best: tuple[float, ...]
    median: tuple[float, ...]
    stop_reason: str
    ends: tuple[float, ...] = ()

    @property
    def ended(self) -> str:
        """Why the search ended, in words."""
        return ended_in_words(self.stop_reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleCommand:
    """The parameters that follow the command, fitted to the tests at one `command` [A or V] alone.

    The other parameters are held at those of the fit to all tests.
    """

    command: float
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Versions, inputs and settings that reproduce the same numbers.

    `settings` is a record for JSON: for a fit, the fields of `FitSettings`, the windows of the tests, and the entries
    of `Fit.with_command`.
    """

    versions: dict[str, str]
    instruction_set: str
    inputs: dict[str, str]
    settings: dict[str, Any]
    rng: Whole
    created: str


def step_in_words(percent: float) -> str:
    """What half the integration step changes, as a clause."""
    return f"half the integration step changes the force by {percent:.2g} % of its deviation"


@array_dataclass(repr=False)
class Fit(WithAxes, Summarised):
    """An identified damper: estimates in the order of the model's spec, quality per test, provenance.

    `n_effective` is the effective number of samples that the standard errors assume, see `effective_samples`; `None`
    where there are no standard errors.
    `intervals` are those of `profile` or `sample`; where there are any, tables show them and not the standard errors.
    `evaluations` counts the simulated candidates of the search and of the selection of starting points;
    `refinement_steps` counts those of the final fit, one simulation with its derivatives each. `identifiability` is
    the result of `uncertainty.identifiability_of`, `None` where it was not computed. `tests` are those of the fit, and
    `forces` those of the free runs on them, [N], shape (n_time,); `warnings` are sentences on what could mislead in
    the result, and `status_reason` says why it has not converged, or what a converged fit costs in a building;
    `motions` recognise the tests of the fit and others of the same motion and command; `tested` are the ranges of
    motion, command and load of the tests; `live_settings` are the settings with the search that ran. A fit that was
    read from its file has neither tests nor forces nor live settings. `half_step_percent` is the change of the force by
    half the integration step, of a damper of the user. `single_commands` are fits at one command each, beside a fit
    whose parameters follow the command.
    """

    _made_by: ClassVar[str] = "mr.identify(model, tests)"

    model: str
    estimates: tuple[Estimate, ...]
    status: FitStatus
    stop_reason: str
    nrmse: NotNegative
    fit_percent: float
    rmse_n: NotNegative
    error_norms: ErrorNorms
    quality: tuple[FitQuality, ...]
    trace: SearchTrace
    evaluations: Whole
    refinement_steps: Whole
    seconds: NotNegative
    n_time: Count
    provenance: Provenance
    current: CurrentLaws | None = None
    own: DamperSpec | None = None
    nuisances: tuple[NuisanceName, ...] = ()
    n_effective: Positive | None = None
    identifiability: Identifiability | None = None
    intervals: Intervals | None = None
    warnings: tuple[str, ...] = ()
    status_reason: str = ""
    motions: tuple[RecordedMotion, ...]
    tested: OperatingRange
    half_step_percent: NotNegative | None = None
    single_commands: tuple[SingleCommand, ...] = ()
    tests: tuple[DamperTest, ...] = field(default=(), compare=False)
    forces: tuple[Floats, ...] = field(default=(), compare=False)
    live_settings: FitSettings | None = field(default=None, compare=False)

    @property
    def spec(self) -> DamperSpec:
        """The model, with the current laws that were identified."""
        plain = damper(self.model) if self.own is None else self.own
        if self.current is None:
            return plain
        laws = dict(zip(plain.names, self.current.laws, strict=True))
        return plain.with_current_laws(laws, unit=self.current.unit, lagged=self.current.lagged)

    @property
    def status_in_words(self) -> str:
        """How the identification ended, with the reason where it has not converged, or with its cost."""
        reason = f" ({self.status_reason})" if self.status_reason else ""
        return f"{self.status.replace('_', ' ')}{reason}"

    @property
    def fingerprint(self) -> str:
        """Digest of the inputs of later verbs: model, parameters, laws, nuisance parameters and tests."""
        values = [(one.name, float(one.value), float(one.lower), float(one.upper)) for one in self.estimates]
        inputs = sorted(self.provenance.inputs.items())
        own = () if self.own is None or self.own.own is None else (self.own.own.digest,)
        return digest_of(self.model, values, self.current, tuple(self.nuisances), inputs, *own)

    @checked
    def observed(self, test: DamperTest) -> DamperTest:
        """The test with the observation model of the fit's settings, or with its own if it has one."""
        return observed(test, self.settings.observe)

    @checked
    def seen(self, test: DamperTest) -> Likeness | None:
        """The test of the fit with the motion, command and force of `test`; `None` if there is none."""
        alike = likest_of_same_force(RecordedMotion.of(test), self.motions)
        if alike is None and test.sha256:
            same = (label for label, digest in self.provenance.inputs.items() if digest == test.sha256)
            alike = next((Likeness(test=test.label, like=label, correlation=1.0) for label in same), None)
        return alike

    @checked
    def other_condition(self, test: DamperTest) -> Likeness | None:
        """The test of the fit with the motion of `test` but another force; `None` without one, or if it is seen."""
        if self.seen(test) is not None:
            return None
        return likest_of_other_force(RecordedMotion.of(test), self.motions)

    @property
    def observation_in_words(self) -> str:
        """A sentence on what the records add to the force of the damper by the fit; empty where they add nothing."""
        tests: dict[str, list[str]] = {}
        for each in self.quality:
            tests.setdefault(each.recorded_in_words, []).append(each.test)
        said = [
            words if len(tests) == 1 else f"{words} in {list_names(own, 3)}"
            for words, own in tests.items()
            if words
        ]
        alone = "equation and parameters are of the damper alone."
        return f"The recorded force is that of the damper, {'; '.join(said)}; {alone}" if said else ""

    @property
    def settings(self) -> FitSettings:
        """The settings of the identification; of a fit that was read from its file, those of its record."""
        if self.live_settings is not None:
            return self.live_settings
        separate = {"nuisances": self.nuisances, "rng": self.provenance.rng}
        return FitSettings.of_record(self.provenance.settings | separate)

    @checked
    def reading(self, *, origin: str = "this fit") -> Reading:
        """How the tests of the fit were read from their files; `origin` names the fit in messages.

        Raises
        ------
        RecordError
            Where this is not recorded, as in a fit of tests that were not read from files.
        """
        return Reading.of_record(self.provenance.settings.get(_READING), origin=origin)

    @property
    def keeps_velocity(self) -> bool:
        """Whether its tests were read with velocity columns that are late by their making."""
        return _READING in self.provenance.settings and self.reading().keep_velocity

    @checked
    def with_command(self, command: str, reading: Reading) -> Fit:
        """The fit with a record of its command line, and of how that read the tests."""
        settings = self.provenance.settings | {"command": command, _READING: reading.as_record()}
        return replace(self, provenance=replace(self.provenance, settings=settings))

    @property
    def ties(self) -> Mapping[str, str]:
        """The expressions of the parameters that are tied to others, by name."""
        recorded = self.provenance.settings.get("ties", {})
        return recorded if isinstance(recorded, Mapping) else {}

    @property
    def parameters(self) -> Mapping[str, FittedParameter]:
        """The parameters by name, each with value, error, unit, bounds and verdict.

        Examples
        --------
        >>> import mrwork as mr
        >>> fit = mr.identify("bingham", mr.synthetic_test("spencer1997"))
        >>> fit.parameters["c0"].unit, fit.parameters["c0"].value > 0.0
        ('N s/m', True)
        """
        return _ByParameter(self.model, {known.name: self._parameter(known) for known in self.estimates})

    def _parameter(self, estimate: Estimate) -> FittedParameter:
        verdict, reason = self.verdict_on(estimate.name)
        return FittedParameter(
            name=estimate.name,
            value=estimate.value,
            error=estimate.standard_error,
            unit=estimate.unit,
            lower=estimate.lower,
            upper=estimate.upper,
            verdict=verdict,
            reason=reason,
            tie=self.ties.get(estimate.name, ""),
        )

    @property
    def theta(self) -> tuple[float, ...]:
        """Parameter values in spec order."""
        return tuple(estimate.value for estimate in self.estimates)

    @property
    def uncertainty_heading(self) -> str:
        """Heading of the column of uncertainties: intervals, or standard errors and how many samples they count."""
        if self.intervals is not None:
            return self.intervals.heading
        if self.n_effective is None:
            return f"standard error, {self.n_time} independent samples"
        return f"standard error, {self.n_effective:.0f} effective samples"

    @checked
    def outside(self, test: DamperTest, force: Samples | None = None) -> Outside:
        """Quantities of a test outside the tested ranges; includes the model's force [N], shape (n_time,), if given."""
        demand = range_of_test(test, self.tested.command_unit, force)
        return outside_of(self.spec, self.theta, self.tested, demand)

    @checked
    def with_intervals(self, intervals: Intervals | None) -> Fit:
        """The fit with intervals in place of standard errors, and their verdicts in place of those by derivatives.

        They are those of `Profiles.intervals` or `Draws.intervals`; `None` takes them away again.
        """
        known = self.identifiability
        return replace(
            self,
            intervals=intervals,
            identifiability=None if known is None else known.with_intervals(intervals),
        )

    @checked
    def with_identifiability(self, identifiability: Identifiability) -> Fit:
        """The fit with verdicts and their standard errors; verdicts of its intervals have precedence."""
        own = identifiability.with_intervals(None)
        return replace(
            self,
            identifiability=own.with_intervals(self.intervals),
            n_effective=own.n_effective if self.n_effective is None else self.n_effective,
            estimates=tuple(estimate.judge(own.verdict_on(estimate.name)) for estimate in self.estimates),
        )

    @checked
    def verdict_on(self, name: str) -> tuple[str, str]:
        """Verdict on a parameter with its reason, from its interval or else from the derivatives at the fit.

        Instead of a verdict "fixed" or "tied", and empty where none is known.

        Raises
        ------
        UnknownNameError
            Where the model has no such parameter.
        """
        estimate = _ByParameter(self.model, {known.name: known for known in self.estimates})[name]
        if estimate.remark == "fixed":
            return "fixed", ""
        if name in self.ties:
            return "tied", f"it is {self.ties[name]}"
        verdict = None if self.identifiability is None else self.identifiability.verdict_on(name)
        interval = None if self.intervals is None else self.intervals.of(name)
        if verdict is not None:
            return verdict.verdict, verdict.reason
        if interval is not None and interval.verdict is not None:
            return interval.verdict, interval.reason
        return ("not identifiable", "") if estimate.remark == "not identifiable" else ("", estimate.remark)

    def _value(self, estimate: Estimate) -> str:
        if self.intervals is None and estimate.standard_error is not None:
            return in_plain(value_and_error(estimate.value, estimate.standard_error)[0])
        return format_rounded(estimate.value, 6)

    def _uncertainty(self, estimate: Estimate) -> str:
        if self.intervals is None:
            return in_plain(value_and_error(estimate.value, estimate.standard_error)[1])
        interval = self.intervals.of(estimate.name)
        return "-" if interval is None else interval.in_words(format_rounded)

    @property
    def plot(self) -> Plots[Fit]:
        """Figures of the fit, see `mr.plots`."""
        return Plots(self)

    def _named_arrays(self) -> NamedArrays:
        parameters = columns_of(
            self.estimates,
            "parameter",
            {
                "value": ("", "value of the fit"),
                "standard_error": ("", self.uncertainty_heading),
                "lower": ("", "lower bound"),
                "upper": ("", "upper bound"),
            },
        )
        verdicts = [self.verdict_on(estimate.name)[0] for estimate in self.estimates]
        intervals = [
            None if self.intervals is None else self.intervals.of(known.name) for known in self.estimates
        ]
        ends = {
            f"interval_{end}": NamedArray.of(
                [None if interval is None else getattr(interval, end) for interval in intervals],
                "parameter",
                long_name=f"{end} end of the interval",
            )
            for end in (() if self.intervals is None else ("lower", "upper"))
        }
        tests = columns_of(
            self.quality,
            "test",
            {
                "fit_percent": ("%", "fit"),
                "nrmse": ("1", "error over the standard deviation of the force"),
                "rmse_n": ("N", "root mean square error"),
                "residual_autocorrelation": ("1", "autocorrelation of the residual"),
                "n_time": ("1", "samples that are compared"),
                "recorded_in_words": ("", "what the record adds to the model's force"),
            },
        )
        search = {
            f"search_{name}": NamedArray.of(getattr(self.trace, name), "generation", long_name=words)
            for name, words in (
                ("evaluations", "simulations so far"),
                ("best", "least misfit so far"),
                ("median", "median misfit of the population"),
            )
        }
        return NamedArrays(
            title=f"Fit of {self.model}",
            rows=("parameter",),
            labels={
                "parameter": labels_of([estimate.name for estimate in self.estimates]),
                "test": labels_of([quality.test for quality in self.quality]),
                "generation": number_labels(len(self.trace.best)),
            },
            along=columns_of(self.estimates, "parameter", {"unit": ("", "unit of the parameter")}),
            arrays={
                **parameters,
                **ends,
                "verdict": NamedArray.of(verdicts, "parameter", long_name="identifiability"),
                **tests,
                **search,
            },
        )

    def as_dict(self) -> dict[str, Any]:
        """Nested dictionaries and lists for JSON, without the tests, the forces and the live settings."""
        document = asdict(replace(self, tests=(), forces=(), live_settings=None))
        del document["tests"], document["forces"], document["live_settings"]
        return document

    def _summary(self) -> Summary:
        tests = "" if len(self.quality) == 1 else f" on {len(self.quality)} tests"
        return Summary(
            title=f"Fit of {self.model}{tests}: {self.fit_percent:.2f} %, {self.status.replace('_', ' ')}",
            facts=(
                ("tests", list_names([quality.test for quality in self.quality])),
                ("error", f"{self.rmse_n:.4g} N rms, {100.0 * self.nrmse:.3g} % of the force's deviation"),
                ("search", f"{self.evaluations} simulations, {self.seconds:.1f} s"),
                ("ended", self.trace.ended),
                ("step", "" if self.half_step_percent is None else step_in_words(self.half_step_percent)),
            ),
            columns=("parameter", "value", self.uncertainty_heading, "unit", "verdict", "reason"),
            rows=[
                (
                    estimate.name,
                    self._value(estimate),
                    self._uncertainty(estimate),
                    estimate.unit,
                    *self.verdict_on(estimate.name),
                )
                for estimate in self.estimates
            ],
            notes=[f"tested: {self.tested.in_words}", *(f"warning: {warning}" for warning in self.warnings)],
        )
