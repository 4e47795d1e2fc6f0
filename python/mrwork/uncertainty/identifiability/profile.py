"""Profile likelihood: the range of each parameter in which the other parameters can compensate for its change.

A profile is the least misfit with one parameter held; its confidence interval leads to a verdict.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from math import nan
from operator import attrgetter
from statistics import NormalDist
from typing import Any, ClassVar, Literal

import numpy as np

from mrwork.base.arguments import Count, Level, NotNegative, Positive, Threads, Whole, checked
from mrwork.base.keys import check_known
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, columns_of
from mrwork.base.numbers import of_unit
from mrwork.base.plotted import Plotted
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table, as_json
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.errors import SettingError
from mrwork.identification.covariance import Slopes, covariance
from mrwork.identification.fit import Fit, beside_likelihood
from mrwork.identification.identify import moved_to
from mrwork.identification.interval import Interval, Verdict, end_in_words
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.problem import Problem
from mrwork.identification.verdicts import Scale, judge_interval, parameter_scales
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.store.long_call import LongCall
from mrwork.uncertainty.identifiability.walks import DIRECTIONS, Point, Side, Sides, WalkRules, signed_root

_BETTER_FIT = RemarkKind(
    "better_fit_found",
    "a better fit was found on the way, which replaces the profiled one: NRMSE {value:.6g} after {before:.6g}",
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Profile(Plotted, WithAxes, Summarised):
    """Least misfit with one parameter held, and likelihood ratio `dof ln(S/S_least)`, at increasing `values`."""

    name: str
    unit: str
    estimate: float
    log: bool
    values: tuple[float, ...]
    misfit: tuple[float, ...]
    ratio: tuple[float, ...]
    interval: Interval
    verdict: Verdict

    def _named_arrays(self) -> NamedArrays:
        return NamedArrays(
            title=f"Profile of {self.name}",
            rows=("point",),
            labels={"point": NamedArray.of(range(len(self.values)))},
            arrays={
                column.key: NamedArray.of(
                    column.value(self), "point", unit=column.unit or self.unit, long_name=column.words
                )
                for column in _POINTS
            },
        )

    def _summary(self) -> Summary:
        interval = self.interval
        limits = ((interval.lower, interval.lower_end), (interval.upper, interval.upper_end))
        ends = [of_unit(value, self.unit) if value is not None else f"open ({end})" for value, end in limits]
        return Summary(
            title=f"Profile of {self.name}: {self.verdict.word}",
            facts=(
                ("estimate", of_unit(self.estimate, self.unit, 5)),
                ("lower end", ends[0]),
                ("upper end", ends[1]),
                ("points", str(len(self.values))),
            ),
            notes=(self.verdict.reason,),
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Profiles(Plotted, WithAxes, Summarised):
    """Profiles of the free parameters of a fit, in the form of its `model` without redundant parameters.

    `threshold` of the likelihood ratio is the quantile of chi-squared with one degree of freedom at `level`. `better`
    replaces the profiled fit where a better one was found on the way; the profiles are about it.
    """

    _made_by: ClassVar[str] = "mr.profile(fit, tests)"

    model: str
    level: Level
    threshold: Positive
    misfit: NotNegative
    n_time: Count
    n_effective: Positive
    profiles: tuple[Profile, ...]
    status: Literal["finished", "interrupted"]
    remarks: tuple[Remark, ...]
    evaluations: Whole
    seconds: NotNegative
    better: Fit | None = field(default=None, compare=False)

    def document(self) -> dict[str, Any]:
        """The fields, without the fit: it has a file of its own."""
        fields = asdict(replace(self, better=None)) | {
            "profiles": [as_json(_COLUMNS, profiled) for profiled in self.profiles]
        }
        return {name: value for name, value in fields.items() if name != "better"}

    def _named_arrays(self) -> NamedArrays:
        n_points = max((len(profiled.values) for profiled in self.profiles), default=0)

        def padded(column: Column) -> Floats:
            rows = [column.value(profiled) for profiled in self.profiles]
            return np.array([[*row, *[nan] * (n_points - len(row))] for row in rows]).reshape(-1, n_points)

        return NamedArrays(
            title=f"Profiles of {self.model}",
            rows=("parameter", "point"),
            labels={
                "parameter": NamedArray.of([profiled.name for profiled in self.profiles]),
                "point": NamedArray.of(range(n_points)),
            },
            along=columns_of(self.profiles, "parameter", _COLUMNS),
            arrays={
                column.key: NamedArray.of(
                    padded(column), "parameter", "point", unit=column.unit, long_name=column.words
                )
                for column in _POINTS
            },
        )

    def _summary(self) -> Summary:
        return Summary(
            title=f"Profiles of {self.model}: intervals at {100.0 * self.level:g} %, {self.status}",
            facts=(
                ("samples", f"{self.n_time}, {self.n_effective:.0f} effective"),
                ("profiled by", f"{self.evaluations} simulations, {self.seconds:.1f} s"),
            ),
            tables=[Table.of(_COLUMNS, self.profiles)],
            remarks=self.remarks,
        )


# What the points of a profile have in arrays, and the profiles in their table, in arrays and in JSON.
_POINTS = (
    Column("value", words="value that is held", of=attrgetter("values")),
    Column("misfit", unit="1", words="least misfit with the parameter held"),
    Column("ratio", unit="1", words="likelihood ratio"),
)
_COLUMNS = (
    Column("name", "parameter"),
    Column("estimate", "estimate", words="value of the fit", shown=5),
    *(
        Column(
            end, end, words=f"{end} end of the interval", shown=end_in_words, of=attrgetter(f"interval.{end}")
        )
        for end in ("lower", "upper")
    ),
    Column("unit", "unit", words="unit of the parameter"),
    Column("verdict", "verdict", words="identifiability", of=attrgetter("verdict.word")),
    Column("reason", "reason", of=attrgetter("verdict.reason")),
    *(Column(end, of=attrgetter(f"interval.{end}")) for end in ("lower_end", "upper_end")),
    *map(Column, ("log", "values", "misfit", "ratio")),
)


def likelihood_threshold(level: float) -> float:
    """Quantile of chi-squared with one degree of freedom, the square of a normal variable."""
    return NormalDist().inv_cdf(0.5 * (1.0 + level)) ** 2


def _profile_of(
    course: WalkRules,
    index: int,
    scale: Scale,
    sensitivity: float,
    below: Side,
    above: Side,
    least: float,
    level: float,
    coherent: float,
) -> Profile:
    """Profile of the free parameter `index` from its two sides, with the same origin, and the verdict."""
    box, origin = course.box, len(below.points) - 1
    line = [*reversed(below.points[1:]), *above.points]
    column = np.array([point.position[index] for point in line])
    roots = np.array([signed_root(point.squared, least, course.dof) for point in line])

    def values_at(column: Floats) -> list[float]:
        positions = np.tile(below.points[0].position, (column.size, 1))
        positions[:, index] = column
        values: list[float] = box.theta_from_unit(positions)[:, box.free[index]].tolist()
        return values

    lower, upper = (
        values_at(_crossing(column[side], roots[side], course.limit))[0]
        if end == "closed" and roots[side].max() > course.limit
        else None
        for side, end in ((slice(origin, None, -1), below.end), (slice(origin, None), above.end))
    )
    values = values_at(column)
    interval = Interval(
        kind="profile", level=level, lower=lower, upper=upper, lower_end=below.end, upper_end=above.end
    )
    return Profile(
        name=scale.name,
        unit=scale.unit,
        estimate=values[origin],
        log=scale.log,
        values=tuple(values),
        misfit=tuple(float(np.sqrt(point.squared)) for point in line),
        ratio=tuple(map(float, roots**2)),
        interval=interval,
        verdict=judge_interval(interval, scale, sensitivity, coherent),
    )


def _crossing(column: Floats, roots: Floats, limit: float) -> Floats:
    """First crossing of the limit outwards, shape (1,), by linear interpolation of the largest root so far."""
    return np.atleast_1d(np.interp(limit, np.maximum.accumulate(roots), column))


# Longest first step of insensitive parameters, in the logarithm or as a share of the size.
_FIRST = 0.3
# A decrease of the likelihood ratio by more than this means that the fit was not at its minimum.
_BETTER = 0.5
# Largest number of restarts about a better minimum, and of the iterations to it.
_MOST_ROUNDS = 3
_MOST_ITERATIONS_OF_RESTART = 50


@checked
def profile(
    fit: Fit,
    tests: DamperTest | Sequence[DamperTest],
    *,
    parameters: Sequence[str] = (),
    level: Level = 0.95,
    threads: Threads = 0,
    on_progress: OnProgress | None = None,
) -> Profiles:
    """Profile likelihood of the free parameters of a fit, both sides of all parameters simulated in one batch.

    With Gaussian errors of unknown variance the likelihood ratio is `n ln(S/S_least)`; here n is replaced by
    `n_eff (1 - n_params/n)` with the effective number of samples. The interval is where the ratio is below the quantile
    of chi-squared with one degree of freedom (Venzon, Moolgavkar, Applied Statistics 37, 1988, 87-94).

    A model with redundant parameters is profiled in the form in which it is identified: along the valley of a Spencer
    Bouc-Wen, gamma and beta cancel to many digits, which no local minimisation can follow.

    Parameters
    ----------
    tests
        The test or tests of the fit.
    parameters
        Profile this parameter only; default all free ones.
    level
        Level of the intervals.
    on_progress
        Called after each batch.

    Raises
    ------
    UnknownNameError
        Where the model has no such parameter.
    SettingError
        Where a parameter is fixed or named twice.
    Interrupted
        On Ctrl-C, carrying the `Profiles` so far, whose ends are "interrupted".
    """
    call = LongCall[Profiles](on_progress=on_progress)
    problem = Problem.of_fit(fit, as_tests(tests), threads=threads).freeing(fit.varied_effects)
    objective, spec, box = problem.objective, problem.form.spec, problem.form.box
    theta = problem.inside(fit.varied_values)
    profiled = _profiled_indices(box, parameters)
    scales = parameter_scales(spec, box, objective.tests, theta, objective.compared[0].free)
    slopes = Slopes.at(objective, problem.form, theta)
    residuals, by_unit = slopes.residuals, box.unit_slope(theta)
    start = Point(position=box.unit_from_theta(theta), squared=float(residuals @ residuals))
    threshold = likelihood_threshold(level)
    independent = covariance(slopes.by_free.T * by_unit, float(np.sqrt(start.squared)))
    errors = np.sqrt(np.diag(independent) * residuals.size / slopes.n_effective)
    longest = _FIRST * np.array([scales[index].size for index in box.free]) / by_unit
    course = WalkRules(
        box=box,
        # The error of a parameter that is not determined is not a number.
        first=np.fmin(0.5 * errors, longest),
        limit=float(np.sqrt(threshold)),
        dof=slopes.dof,
        spring=problem.form.mirrored,
    )

    def result(sides: Sides, status: Literal["finished", "interrupted"], of: Fit = fit) -> Profiles:
        least = min(point.squared for side in sides.values() for point in side.points)
        improvement = signed_root(start.squared, least, course.dof) ** 2
        made = tuple(
            _profile_of(
                course,
                index,
                scales[box.free[index]],
                float(np.linalg.norm(slopes.by_free[index])),
                sides[index, -1],
                sides[index, 1],
                least,
                level,
                of.coherent,
            )
            for index in profiled
        )
        return Profiles(
            model=spec.name,
            level=level,
            threshold=threshold,
            misfit=float(np.sqrt(least)),
            n_time=residuals.size,
            n_effective=slopes.n_effective,
            profiles=made,
            status=status,
            remarks=(
                *(
                    ()
                    if improvement < _BETTER
                    else (_BETTER_FIT.remark(measured=Measured(float(np.sqrt(least)), ""), before=fit.nrmse),)
                ),
                *beside_likelihood(of, {profiled.name: profiled.interval.error for profiled in made}),
            ),
            evaluations=objective.tally.simulations,
            seconds=call.seconds,
        )

    def report(sides: Sides) -> None:
        ended = sum(side.end != "interrupted" for side in sides.values())
        points = sum(len(side.points) - 1 for side in sides.values())
        call.report(
            Progress(
                stage="profile",
                said=(f"{ended} of {len(sides)} sides", f"{points} points"),
                share=ended / len(sides) if sides else None,
                numbers={"points": points, "evaluations": objective.tally.simulations},
                rated=("evaluations",),
            )
        )

    origin = start
    sides: Sides = {(index, way): Side(points=[start]) for index in profiled for way in DIRECTIONS}
    call.so_far = lambda: result(sides, "interrupted")
    with call.keeping("profiling"):
        for _ in range(_MOST_ROUNDS):
            sides = {key: Side(points=[origin]) for key in sides}
            course.run(objective, sides, report)
            best = min(
                (point for side in sides.values() for point in side.points), key=lambda point: point.squared
            )
            if signed_root(origin.squared, best.squared, course.dof) ** 2 < _BETTER:
                break
            better = box.theta_from_unit(best.position[None])
            minimum = find_minima(objective, box, better, max_iterations=_MOST_ITERATIONS_OF_RESTART).best
            origin = Point(position=box.unit_from_theta(minimum.theta), squared=minimum.misfit**2)
        better = None
        if origin is not start:
            found = problem.form.to_model(box.theta_from_unit(origin.position))[: len(fit.theta)]
            better = moved_to(
                fit,
                objective.tests,
                np.asarray(found),
                found_by="a profile of its parameters",
                threads=threads,
            )
    return replace(result(sides, "finished", better or fit), better=better)


def _profiled_indices(box: Box, parameters: Sequence[str]) -> list[int]:
    free = [box.names[index] for index in box.free]
    if len(set(parameters)) < len(parameters):
        raise SettingError(f"`parameters` are {', '.join(parameters)}; name each once")
    for name in parameters:
        check_known(name, box.names, f"no parameter is called {name!r}", otherwise="this model has")
        if name not in free:
            raise SettingError(f"{name} is fixed; only free parameters have a profile: {', '.join(free)}")
    return [number for number, name in enumerate(free) if not parameters or name in parameters]
