"""The result of an identification: parameters and how certain they are, quality of the fit, provenance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import sqrt
from operator import attrgetter
from statistics import median
from typing import Any, ClassVar, Literal

from mrwork.base.arguments import Count, NotNegative, Positive, Samples, Whole, checked
from mrwork.base.keys import suggestion
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, columns_of
from mrwork.base.numbers import format_rounded, in_plain, of_unit, value_and_error
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, list_names, named
from mrwork.base.table import Column, Table, as_json
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.dependence import CurrentLaws
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.dampers.tested_range import outside_of
from mrwork.errors import RecordError, UnknownNameError
from mrwork.identification.interval import NOT_JUDGED, Interval, Judged, Verdict
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, Observation, observed
from mrwork.records.damper_test import OperatingRange, Outside, range_of_test
from mrwork.records.likeness import Likeness, RecordedMotion, likest
from mrwork.records.observation import AS_IT_IS, EFFECTS, Effect
from mrwork.records.reading import Reading
from mrwork.search.rules import ended_in_words
from mrwork.store.codec import built, digest_of

ParameterState = Literal["", "fixed", "at lower bound", "at upper bound", "told by sliders"]

# Errors of a fit above this multiple of those by the likelihood alone are of something that no likelihood counts.
_FURTHER = 1.5
_LIKELIHOOD_ALONE = RemarkKind(
    "errors_of_likelihood",
    "errors of the fit are larger than the ones here, those of {0}: they count how far a mass, a lag or a delay moves "
    "where tests are left out, and a likelihood of the residuals does not",
    "quote the errors of the fit",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedParameter:
    """One parameter of a fit, in SI: value, uncertainty, bounds, and what the data say of it.

    `standard_error` follows from the Jacobian and counts `Fit.n_effective` samples, fewer than there are where
    residuals are correlated. It is `None` where the derivatives do not determine the parameter, or to no better than a
    hundred times its value, where it was fixed, or is on a bound (`state`). The `verdict` is by the `interval`, if
    there is one, else by the standard error.
    `tie` is the expression that the parameter is tied to, empty where it is not.
    """

    _made_by: ClassVar[str] = "fit.parameters"

    name: str
    value: float
    unit: str
    standard_error: NotNegative | None
    lower: float
    upper: float
    state: ParameterState = ""
    verdict: Verdict = NOT_JUDGED
    tie: str = ""
    interval: Interval | None = None

    @property
    def is_free(self) -> bool:
        """Whether the search could vary the parameter, which was not held fixed."""
        return self.state != "fixed"

    @property
    def at_bound(self) -> bool:
        """Whether the search ended with the parameter at its lower or upper bound."""
        return self.state in ("at lower bound", "at upper bound")

    def judged_by(self, row: Judged | None, *, counts_more: bool) -> FittedParameter:
        """The parameter with the interval that a row has of it, if any, and with the verdict by that if it has one.

        Where the error of the fit `counts_more` than a likelihood, and is larger, its verdict stays.
        """
        if row is None or row.interval is None:
            return self
        stays = not row.verdict.word or (counts_more and self.times(row.interval.error) > _FURTHER)
        return replace(self, interval=row.interval, verdict=self.verdict if stays else row.verdict)

    def times(self, error: float) -> float:
        """The standard error as a multiple of another `error`; zero where one of them is not known."""
        return self.standard_error / error if self.standard_error and error > 0.0 else 0.0

    def in_words(self, *, by_interval: bool) -> tuple[str, str]:
        """Value and uncertainty for a terminal: an interval, or a standard error with the digits that it leaves."""
        if by_interval:
            ends = "-" if self.interval is None else self.interval.in_words(format_rounded)
            return format_rounded(self.value, 6), ends
        value, error = map(in_plain, value_and_error(self.value, self.standard_error))
        return (format_rounded(self.value, 6) if self.standard_error is None else value), error


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


# Key that the command line adds to the record of the settings.
_READING = "reading"
# Share by which a value may exceed its bound after a conversion between forms of a model.
_OVER_BOUND = 1e-6

STRUCTURE = 3.0
"""Multiple of the noise of the force from which on a residual is structure."""

NEGLIGIBLE = 0.1
"""Negligible difference in fit [percentage points]: the cycles of a real test repeat to 97-99 %."""

FAR_BETTER = 0.8
"""Share of an error below which other laws with as many parameters are better by what they are fitted to."""

FitStatus = Literal["converged", "lower_minimum_possible", "not_converged", "interrupted", "stopped"]
"""How a fit ended; converged is that two routes of the search agree on the minimum, and the final fit reached it."""

STATUS_IN_WORDS: Mapping[str, str] = {
    "converged": "converged",
    "lower_minimum_possible": "a lower minimum is possible",
    "not_converged": "not converged",
    "interrupted": "interrupted",
    "stopped": "stopped",
}


class _ByName(dict[str, FittedParameter]):
    """Parameters of a fit by name; the refusal of an unknown name suggests similar ones."""

    def __missing__(self, name: str) -> FittedParameter:
        raise UnknownNameError(
            f"the fit has no parameter {name!r}{suggestion(name, [*self], otherwise='it has')}"
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
    effects `estimated` for this test were applied to the simulated force before the comparison. Of a `constant` force,
    as of a stroke at one speed, a fit in per cent of its deviation says nothing.
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
    estimated: Observation = AS_IT_IS
    constant: bool = False

    @property
    def fit_in_words(self) -> str:
        """The fit in per cent; of a force that hardly varies it says nothing."""
        return "-" if self.constant else f"{self.fit_percent:.2f}"

    @property
    def recorded_in_words(self) -> str:
        """What was applied to the model's force before the comparison, as a participle; empty for nothing."""
        return ", ".join(filter(None, (self.observation.in_words, self.estimated.in_words)))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SearchTrace(Summarised):
    """One entry per generation: simulations so far, least and median misfit (NRMSE) of the population.

    For `Race` an entry is one iteration of all running local minimisations; `ends` are the final misfits, sorted.
    """

    _made_by: ClassVar[str] = "fit.trace"

    evaluations: tuple[Whole, ...]
    best: tuple[float, ...]
    median: tuple[float, ...]
    stop_reason: str
    ends: tuple[float, ...] = ()

    @property
    def ended(self) -> str:
        """The stop reason as a clause for people."""
        return ended_in_words(self.stop_reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleCommand:
    """The parameters that follow the command, fitted to the tests at one `command` [A or V] alone.

    The other parameters are held at their values in the fit to all tests.
    """

    command: float
    estimates: tuple[FittedParameter, ...]


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


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSpread:
    """Fits of several tests [%]: the median, and the worst with the name of its test."""

    n_tests: int
    median_percent: float
    worst_percent: float
    worst_test: str

    @classmethod
    def of(cls, names: Sequence[str], percents: Sequence[float]) -> FitSpread:
        """Median and worst of the fits of the tests with these names."""
        worst = min(range(len(percents)), key=percents.__getitem__)
        return cls(
            n_tests=len(percents),
            median_percent=float(median(percents)),
            worst_percent=float(percents[worst]),
            worst_test=names[worst],
        )

    @property
    def in_words(self) -> str:
        """Number of tests, median and worst fit with the name of the worst test, in one line."""
        return (
            f"{self.n_tests} tests: fit median {self.median_percent:.2f} %, worst {self.worst_percent:.2f} % "
            f"({self.worst_test})"
        )


@array_dataclass(repr=False)
class Fit(Plotted, WithAxes, Summarised):
    """An identified damper: estimates in the order of the model's spec, quality per test, provenance.

    `n_effective` is the effective number of samples that the standard errors assume, see `effective_samples`; `None`
    where there are no standard errors. `directions` are those in which the data determine the parameters weakly or not
    at all. Where `profile` or `sample` has found intervals, tables show these and not the standard errors.
    `effects` are those on the recorded force, common to all tests, that were fitted with the parameters. `others` are
    fits of other sets of laws that predict nearly as well, with which predictions are compared.
    `force_noise_n` is the noise of the forces of the tests from sample to sample [N].
    `evaluations` counts the simulated candidates of the search and of the selection of starting points;
    `refinement_steps` counts steps of the final fit, one simulation with its derivatives each. `tests` were fitted, and
    `forces` are the forces of free runs on them, [N], shape (n_time,); `remarks` say what could mislead in the
    result, and `status_reason` says why it has not converged, or what a converged fit costs in a
    building; `motions` recognise the tests of the fit and others of the same motion and command; `tested` are the
    ranges of motion, command and load of the tests; `live_settings` are the settings with the search that ran. A fit
    that was read from its file has neither tests nor forces nor live settings. `half_step_percent` is the change of
    the force by half the integration step, of a damper of the user. `single_commands` are fits at one command each,
    beside a fit whose parameters follow the command.
    """

    _made_by: ClassVar[str] = "mr.identify(model, tests)"

    model: str
    estimates: tuple[FittedParameter, ...]
    status: FitStatus
    stop_reason: str
    nrmse: NotNegative
    fit_percent: float
    rmse_n: NotNegative
    force_noise_n: NotNegative | None = None
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
    n_effective: Positive | None = None
    directions: tuple[Direction, ...] = ()
    remarks: tuple[Remark, ...] = ()
    status_reason: str = ""
    motions: tuple[RecordedMotion, ...]
    tested: OperatingRange
    half_step_percent: NotNegative | None = None
    single_commands: tuple[SingleCommand, ...] = ()
    effects: tuple[FittedParameter, ...] = ()
    tests: tuple[DamperTest, ...] = field(default=(), compare=False)
    forces: tuple[Floats, ...] = field(default=(), compare=False)
    live_settings: FitSettings | None = field(default=None, compare=False)
    others: tuple[Fit, ...] = field(default=(), compare=False)

    @property
    def spec(self) -> DamperSpec:
        """The model, with the current laws that were identified."""
        plain = damper(self.model) if self.own is None else self.own
        if self.current is None:
            return plain
        laws = dict(zip(plain.names, self.current.laws, strict=True))
        return plain.with_current_laws(laws, unit=self.current.unit, lag=self.current.lag)

    @property
    def status_in_words(self) -> str:
        """How the identification ended, with the reason where it has not converged, or with its cost."""
        reason = f" ({self.status_reason})" if self.status_reason else ""
        return f"{STATUS_IN_WORDS[self.status]}{reason}"

    @property
    def fingerprint(self) -> str:
        """Digest of the inputs of later verbs: model, parameters, laws, effects of each test and tests."""
        values = [
            (estimate.name, float(estimate.value), float(estimate.lower), float(estimate.upper))
            for estimate in self.estimates
        ]
        inputs = sorted(self.provenance.inputs.items())
        equations = () if self.own is None or self.own.own is None else (self.own.own.digest,)
        each = [effect.name for effect in self.settings.observing.of_each]
        return digest_of(self.model, values, self.current, each, inputs, *equations)

    @checked
    def observed(self, test: DamperTest) -> DamperTest:
        """The test with the observation model of the fit's settings, or with its own if it has one."""
        return observed(test, self.settings.observing)

    @checked
    def seen(self, test: DamperTest) -> Likeness | None:
        """The test of the fit with the motion, command and force of `test`; `None` if there is none."""
        alike = likest(RecordedMotion.of(test), self.motions, force="same")
        if alike is None and test.sha256:
            same = (label for label, digest in self.provenance.inputs.items() if digest == test.sha256)
            alike = next((Likeness(test=test.label, like=label, correlation=1.0) for label in same), None)
        return alike

    @checked
    def other_condition(self, test: DamperTest) -> Likeness | None:
        """The test of the fit with the motion of `test` but another force; `None` without one, or if it is seen."""
        if self.seen(test) is not None:
            return None
        return likest(RecordedMotion.of(test), self.motions, force="other")

    @property
    def observation_in_words(self) -> str:
        """A sentence on what the records add to the force of the damper by the fit; empty where they add nothing."""
        names_by_words: dict[str, list[str]] = {}
        for quality_of_test in self.quality:
            names_by_words.setdefault(quality_of_test.recorded_in_words, []).append(quality_of_test.test)
        parts = [
            words if len(names_by_words) == 1 else f"{words} in {list_names(names, 3)}"
            for words, names in names_by_words.items()
            if words
        ]
        alone = "equation and parameters are of the damper alone."
        return f"The recorded force is that of the damper, {'; '.join(parts)}; {alone}" if parts else ""

    @property
    def settings(self) -> FitSettings:
        """The settings of the identification; of a fit that was read from its file, the recorded ones."""
        if self.live_settings is not None:
            return self.live_settings
        return FitSettings.of_record(self.provenance.settings | {"rng": self.provenance.rng})

    @checked
    def reading(self, *, origin: str = "this fit") -> Reading:
        """How the tests of the fit were read from their files; `origin` names the fit in messages.

        Raises
        ------
        RecordError
            Where this is not recorded, as in a fit of tests that were not read from files.
        """
        if _READING not in self.provenance.settings:
            raise RecordError(f"{origin} does not say how its tests were read; run `mrwork identify` again")
        reading: Reading = built(Reading, self.provenance.settings[_READING])
        return reading

    @property
    def keeps_velocity(self) -> bool:
        """Whether its tests were read with velocity columns that are late by their making."""
        return _READING in self.provenance.settings and self.reading().keep_velocity

    @checked
    def with_command(self, command: str, reading: Reading) -> Fit:
        """The fit with a record of its command line, and of how that read the tests."""
        settings = self.provenance.settings | {"command": command, _READING: asdict(reading)}
        return replace(self, provenance=replace(self.provenance, settings=settings))

    @property
    def ties(self) -> Mapping[str, str]:
        """The expressions of the parameters that are tied to others, by name."""
        return self.settings.ties

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
        return _ByName({estimate.name: estimate for estimate in self.estimates})

    @property
    def fitted(self) -> tuple[FittedParameter, ...]:
        """The parameters, and the effects on the recorded force that were fitted with them."""
        return (*self.estimates, *self.effects)

    @property
    def effect_values(self) -> dict[Effect, float]:
        """Values of the fitted effects on the recorded force."""
        values = {estimate.name: estimate.value for estimate in self.effects}
        return {effect: values[effect.parameter] for effect in EFFECTS.values() if effect.parameter in values}

    @property
    def varied(self) -> tuple[FittedParameter, ...]:
        """The parameters, and the effects that vary with them: those that sliders have told are given to the model."""
        return (*self.estimates, *(effect for effect in self.effects if effect.state != "told by sliders"))

    @property
    def varied_effects(self) -> tuple[Effect, ...]:
        """The effects on the recorded force that vary with the parameters."""
        names = {estimate.name for estimate in self.varied}
        return tuple(effect for effect in self.effect_values if effect.parameter in names)

    @property
    def varied_values(self) -> tuple[float, ...]:
        """Values of the parameters in spec order, and then of the effects that vary with them."""
        return tuple(estimate.value for estimate in self.varied)

    @property
    def theta(self) -> tuple[float, ...]:
        """Parameter values in spec order."""
        return tuple(estimate.value for estimate in self.estimates)

    @property
    def uncertainty_heading(self) -> str:
        """Heading of the column of uncertainties: intervals, or standard errors and how many samples they count."""
        if self.an_interval is not None:
            return self.an_interval.heading
        if self.n_effective is None:
            return f"standard error, {self.n_time} independent samples"
        return f"standard error, {self.n_effective:.0f} effective samples"

    @checked
    def outside(self, test: DamperTest, force: Samples | None = None) -> Outside:
        """Quantities of a test outside the tested ranges; includes the model's force [N], shape (n_time,), if given."""
        demand = range_of_test(test, self.tested.command_unit, force)
        return outside_of(self.spec, self.theta, self.tested, demand)

    @property
    def an_interval(self) -> Interval | None:
        """One of the intervals of the parameters, which are all of one kind and level; `None` before there are any."""
        return next((estimate.interval for estimate in self.estimates if estimate.interval), None)

    @checked
    def with_intervals(self, judged: Sequence[Judged]) -> Fit:
        """The fit with the intervals of `Profiles.profiles` or `Draws.summaries`, and the verdicts by them."""
        of, counts_more = {row.name: row for row in judged}, bool(self.effects)
        estimates = [
            estimate.judged_by(of.get(estimate.name), counts_more=counts_more) for estimate in self.estimates
        ]
        return replace(self, estimates=tuple(estimates))

    @property
    def has_constant(self) -> bool:
        """Whether a test has a force that hardly varies, so that a share of its deviation says nothing."""
        return any(quality.constant for quality in self.quality)

    @property
    def fit_in_words(self) -> str:
        """The fit to all tests, such as "93.97 %", or the error in newtons where a share says nothing."""
        return f"{self.rmse_n:.4g} N rms" if self.has_constant else f"{self.fit_percent:.2f} %"

    @property
    def times_noise(self) -> float | None:
        """The residual over the noise of the force, where it is structure and not noise; else `None`."""
        times = self.rmse_n / self.force_noise_n if self.force_noise_n else 0.0
        return times if times > STRUCTURE else None

    @property
    def coherent(self) -> float:
        """Standard errors by which twice the residual could move a parameter where that is structure, else 1.

        Such a force may be of one sign in a parameter, as if it were one sample. It is twice the residual because the
        parameters have taken a part of it: on 36 dampers of other forms they moved by 2.0 times the residual at most.
        """
        return 1.0 if self.times_noise is None or self.n_effective is None else 2.0 * sqrt(self.n_effective)

    @property
    def informative(self) -> tuple[Direction, ...]:
        """The directions without those dominated by an identifiable or negligible parameter."""
        settled = {
            estimate.name
            for estimate in self.estimates
            if estimate.verdict.word in ("identifiable", "model-dependent", "negligible")
        }
        return tuple(
            direction
            for direction in self.directions
            if not direction.seen or direction.changes[0].name not in settled
        )

    @property
    def _columns(self) -> tuple[Column, ...]:
        """What the parameters have in tables, in JSON and in arrays."""

        def in_words(estimate: FittedParameter) -> tuple[str, str]:
            return estimate.in_words(by_interval=self.an_interval is not None)

        return (
            Column("", "parameter", of=attrgetter("name")),
            Column("", "value", of=lambda estimate: in_words(estimate)[0]),
            Column("", self.uncertainty_heading, of=lambda estimate: in_words(estimate)[1]),
            Column("value", words="value of the fit"),
            Column("standard_error", words="standard error"),
            Column("unit", "unit"),
            Column("lower", words="lower bound"),
            Column("upper", words="upper bound"),
            Column("state"),
            Column("verdict", "verdict", words="identifiability", of=attrgetter("verdict.word")),
            Column("reason", "reason", of=attrgetter("verdict.reason")),
        )

    def _named_arrays(self) -> NamedArrays:
        parameters = columns_of(self.estimates, "parameter", self._columns)
        ends = {
            f"interval_{end}": NamedArray.of(
                [
                    None if estimate.interval is None else getattr(estimate.interval, end)
                    for estimate in self.estimates
                ],
                "parameter",
                long_name=f"{end} end of the interval",
            )
            for end in (() if self.an_interval is None else ("lower", "upper"))
        }
        tests = columns_of(self.quality, "test", _QUALITY)
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
                "parameter": NamedArray.of([estimate.name for estimate in self.estimates]),
                "test": NamedArray.of([quality.test for quality in self.quality]),
                "generation": NamedArray.of(range(len(self.trace.best))),
            },
            along=columns_of(self.estimates, "parameter", [Column("unit", words="unit of the parameter")]),
            arrays={**parameters, **ends, **tests, **search},
        )

    @property
    def spread(self) -> FitSpread | None:
        """Median and worst of the fits of the tests; `None` for one test."""
        if len(self.quality) == 1:
            return None
        return FitSpread.of(
            [quality_of_test.test for quality_of_test in self.quality],
            [quality_of_test.fit_percent for quality_of_test in self.quality],
        )

    def as_dict(self) -> dict[str, Any]:
        """Nested dictionaries and lists for the file of the fit, without tests, forces, live settings and others."""
        bare = replace(self, tests=(), forces=(), live_settings=None, others=())
        apart = ("tests", "forces", "live_settings", "others")
        return {name: value for name, value in asdict(bare).items() if name not in apart}

    def document(self) -> dict[str, Any]:
        """What `mrwork identify --json` prints; `files` name each test as `test` and, as `predict` does, as `file`."""
        spread = self.spread
        return {
            "model": self.model,
            "parameters": {estimate.name: as_json(self._columns, estimate) for estimate in self.fitted},
            "uncertainty": self.uncertainty_heading,
            "current_laws": None if self.current is None else asdict(self.current),
            "directions": [asdict(direction) for direction in self.directions],
            "observation": self.observation_in_words,
            **named(self, "fit_percent", "nrmse", "rmse_n", "force_noise_n"),
            "error_norms": asdict(self.error_norms),
            **named(self, "status", "status_reason", "stop_reason"),
            "tested_range": asdict(self.tested),
            "remarks": [asdict(remark) for remark in self.remarks],
            **named(self, "evaluations", "refinement_steps", "seconds", "n_time", "n_effective"),
            "rng": self.provenance.rng,
            "files": [
                {"file": quality_of_test.test, **asdict(quality_of_test)} for quality_of_test in self.quality
            ],
            "median_fit_percent": None if spread is None else spread.median_percent,
            "worst_fit_percent": None if spread is None else spread.worst_percent,
            "spread": None if spread is None else asdict(spread),
        }

    def _summary(self) -> Summary:
        on_tests = "" if len(self.quality) == 1 else f" on {len(self.quality)} tests"
        of_deviation = f", {100.0 * self.nrmse:.3g} % of the force's deviation"
        share = "; the force of a test is constant" if self.has_constant else of_deviation
        tables = [Table.of(self._columns, self.fitted)]
        tables += [Table.of(_QUALITY, self.quality)] if len(self.quality) > 1 else []
        return Summary(
            title=f"Fit of {self.model}{on_tests}: {self.fit_in_words}, {self.status_in_words}",
            facts=(
                ("tests", list_names([quality.test for quality in self.quality])),
                ("error", f"{self.rmse_n:.4g} N rms{share}"),
                ("tested", self.tested.in_words),
                ("search", f"{self.evaluations} simulations, {self.seconds:.1f} s"),
                ("ended", self.trace.ended),
                ("step", "" if self.half_step_percent is None else step_in_words(self.half_step_percent)),
            ),
            remarks=self.remarks,
            tables=tables,
            notes=[direction.sentence for direction in self.informative],
        )


def beside_likelihood(fit: Fit, errors: Mapping[str, float]) -> Iterator[Remark]:
    """What `errors` of parameters by a likelihood, by their names, do not count: a wrong model, and effects.

    Errors that are not finite are not compared.
    """
    yield from (remark for remark in fit.remarks if remark.code == "residual_is_structure")
    if not fit.effects:
        return
    times = {each.name: each.times(errors[each.name]) for each in fit.fitted if each.name in errors}
    larger = [name for name, ratio in times.items() if ratio > _FURTHER]
    if larger:
        ratios = list_names([f"{name} {times[name]:.2g} times" for name in larger])
        most = Measured(max(times[name] for name in larger), "")
        yield _LIKELIHOOD_ALONE.remark(ratios, measured=most)


# What the tests of a fit have in tables and in arrays.
_QUALITY = (
    Column("test", "test"),
    Column("fit_percent", unit="%", words="fit"),
    Column("", "fit", "%", of=attrgetter("fit_in_words")),
    Column("nrmse", unit="1", words="error over the standard deviation of the force"),
    Column("rmse_n", "RMSE", "N", "root mean square error"),
    Column("residual_autocorrelation", unit="1", words="autocorrelation of the residual"),
    Column("n_time", unit="1", words="samples that are compared"),
    Column("recorded_in_words", "the model force", words="what the record adds to the model's force"),
)
