"""Predictions of tests by fits that have not seen them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import field, replace
from typing import ClassVar
from warnings import warn

import numpy as np

from mrwork.base.arguments import Count, checked
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.law_sets import SetsApart, sets_apart
from mrwork.dampers.tested_range import Outside, half_cycle_ends
from mrwork.errors import MrworkError, MrworkWarning, SettingError, SimulationError
from mrwork.identification.commands import are_determined
from mrwork.identification.fit import Fit, FitQuality
from mrwork.identification.residual import ObservedTest
from mrwork.identification.result import explain_failures, fit_quality, free_run, rms
from mrwork.identification.settings import Fold as Fold
from mrwork.records import DamperTest, Likeness, observed
from mrwork.records.damper_test import command_groups, range_of_test
from mrwork.records.likeness import RecordedMotion, alike_groups, likenesses_in_words, likest
from mrwork.records.motion import regular_cycles, whole_cycles
from mrwork.records.observation import AS_IT_IS, Observation, Observing

IN_WORDS: dict[Fold, str] = {
    "test": "each predicted without itself",
    "motion": "each predicted without the tests of its motion",
    "command": "each predicted without the tests at its command",
}

CHOSEN_WITH_ALL = ", by the model and the laws that all tests chose"
UNSEEN = "the fit has not seen"
LATER_CYCLES = "later cycles of one test, fitted on the earlier ones"
ONE_TEST = RemarkKind(
    "one_test",
    "one test was given, fitted on the first half of its cycles and evaluated on the second: cycles of one test repeat "
    "to 97-99 %, so this is little evidence",
    "give tests at other motions",
)

# Identifies the damper from tests; `None` where they leave it open.
IdentifyRest = Callable[[tuple[DamperTest, ...]], Fit | None]

# Strokes and cycle lengths of one motion differ by less than this share: rigs repeat them to a few per cent.
_SAME_MOTION = 0.15
# Share of a cycle to either side over which the change of the force counts: errors in time matter where it is steep.
_REACH = 0.02
# Factor from an extreme within which tests are left out together, and share of the tests that must remain.
_OF_EXTREME = ((1.4, 0.5), (1.1, 0.0))
# Frequency of a test without a whole cycle [Hz].
_LOWEST = 1e-3
_LEFT_OPEN = RemarkKind(
    "left_open",
    "{value:.0f} of the tests left out are not predicted, as the others leave a law or a rate of the driver open: "
    "{0}",
    "add tests at other commands, of a rate such with a command that varies",
)
_LEFT_OUT_TOGETHER = RemarkKind("tests_alike", "left out together, as they are alike: {0}")


@array_dataclass(repr=False)
class Prediction(Plotted, WithAxes, Summarised):
    """A test and the model's force on it [N], shape (n_time,), with the observation model applied.

    `seen` is the test of the fit that this one is, or whose motion and command it has, `None` where it is like none:
    only then does the error tell how the fit predicts. `outside` is what of the test lies outside the
    tested ranges of the fit. `other_forces` are of other sets of laws [N], shape (n_sets, n_time), and
    `sets_apart` how far they are apart where the tests of the fit end, `None` where the test does not reach there.
    `substeps` is the number in a sample, `estimated` the effects that were estimated from the test itself. `n_cycles`
    are those of a compared motion that repeats, see `regular_cycles`, and none of any other: calibrations ask often.
    Properties are of the counted samples, shape (n_counted,).
    """

    _made_by: ClassVar[str] = "mr.predict(fit, test)"

    test: DamperTest
    model_force: Floats
    seen: Likeness | None = None
    outside: Outside = field(default=Outside(known=False), repr=False)
    substeps: Count = 1
    estimated: Observation = AS_IT_IS
    other_forces: Floats = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    sets_apart: SetsApart | None = None
    n_cycles: int = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "n_cycles", len(regular_cycles(self.test.displacement[self.test.counted])))

    @property
    def force(self) -> Floats:
        """The model's force [N] at the compared samples, shape (n_counted,)."""
        return self.model_force[self.test.counted]

    @property
    def measured(self) -> Floats:
        """The measured force [N] at the compared samples, shape (n_counted,)."""
        return self.test.force[self.test.counted]

    @property
    def residual(self) -> Floats:
        """Measured minus model force [N] at the compared samples, shape (n_counted,)."""
        return self.measured - self.force

    @property
    def deviation(self) -> float:
        """Standard deviation of the model's force [N]: the scale of its errors, known without a measurement."""
        return float(np.std(self.force))

    @property
    def steepness(self) -> Floats:
        """Change of the model's force over 4 % of a cycle, per standard deviation."""
        reach = max(1, round(_REACH * mean_cycle(self.test)))
        padded = np.pad(self.force, reach, mode="edge")
        return np.asarray(np.abs(padded[2 * reach :] - padded[: -2 * reach]) / self.deviation)

    @property
    def speed(self) -> float:
        """Root mean square of the velocity [m/s] at the compared samples."""
        return rms(self.test.velocity[self.test.counted])

    @property
    def half_cycles(self) -> Floats:
        """Stroke [m] of the half cycle of each sample, or of the one before, which it starts from, if that is shorter.

        It is infinite where the motion repeats, which is beyond the tests as a whole or not at all.
        """
        if self.n_cycles:
            return np.full(self.force.size, np.inf)
        ends = half_cycle_ends(self.test.displacement)
        between = np.searchsorted(ends[1:-1], np.arange(self.test.n_time), side="right")
        strokes = np.abs(np.diff(self.test.displacement[ends]))
        strokes[1:] = np.minimum(strokes[1:], strokes[:-1])
        return strokes[between][self.test.counted]

    @property
    def phase(self) -> Floats:
        """Phase of the motion in its cycle, -pi to pi: the angle of velocity and displacement, each per its peak."""
        x = self.test.displacement[self.test.counted]
        v = self.test.velocity[self.test.counted]
        x = x - 0.5 * (x.max() + x.min())
        # Of a damper that rests while it is compared, the phase is zero.
        return np.asarray(np.arctan2(v / (np.max(np.abs(v)) or 1.0), x / (np.max(np.abs(x)) or 1.0)))

    @property
    def quality(self) -> FitQuality:
        """The errors of the prediction, as a fit has them of its tests."""
        return fit_quality(self.test, self.model_force, substeps=self.substeps, estimated=self.estimated)

    @property
    def nrmse(self) -> float:
        """Root mean square of the residual, per standard deviation of the measured force."""
        return rms(self.residual) / float(np.std(self.measured))

    @property
    def fit_percent(self) -> float:
        """Fit to the measured force [%]."""
        return 100.0 * (1.0 - self.nrmse)

    @property
    def rmse_n(self) -> float:
        """Root mean square of the residual [N]."""
        return rms(self.residual)

    def _named_arrays(self) -> NamedArrays:
        of_test = self.test._named_arrays()
        forces = {
            "model_force": (self.model_force, "force of the model, as it would be recorded"),
            "residual": (self.test.force - self.model_force, "measured minus model force"),
        }
        arrays = {
            name: NamedArray.of(values, "time", unit="N", long_name=words)
            for name, (values, words) in forces.items()
        }
        return replace(of_test, title=f"Prediction of {self.test.name}", arrays={**of_test.arrays, **arrays})

    def _summary(self) -> Summary:
        return Summary(
            title=f"Prediction of {self.test.name}",
            facts=(
                ("fit", "" if self.quality.constant else f"{self.fit_percent:.2f} %"),
                ("error", f"{self.rmse_n:.4g} N rms, at most {np.abs(self.residual).max():.4g} N"),
                ("samples", f"{self.force.size} compared of {self.test.n_time}"),
                ("seen by the fit", "no" if self.seen is None else self.seen.in_words),
            ),
            remarks=self.outside.remarks,
            notes=[] if self.sets_apart is None else [self.sets_apart.in_words],
        )


def predictions_of(fit: Fit, tests: Sequence[DamperTest]) -> tuple[Prediction, ...]:
    """The tests of a fit with the forces of its model, which are simulated where the fit was read from its file."""
    theta = np.array(fit.theta)
    tests = [fit.observed(test) for test in tests]
    forces = fit.forces or tuple(
        free_run(fit.spec, theta, test, each=fit.settings.observing.of_each)[0] for test in tests
    )
    return tuple(Prediction(test=test, model_force=force) for test, force in zip(tests, forces, strict=True))


def with_others(prediction: Prediction, fit: Fit, observing: Observing) -> Prediction:
    """The prediction with the forces of the other fits that are as good, without those that cannot be simulated."""
    test, forces = prediction.test, [prediction.model_force]
    for other in fit.others:
        observed = ObservedTest.of(other.spec, test, observing.of_each)
        with suppress(SimulationError):
            forces.append(observed.predict_force(np.array(other.theta))[0])
    if len(forces) == 1:
        return prediction
    command = test.command_in(fit.tested.command_unit)
    apart = sets_apart(
        fit.tested,
        test.displacement[test.counted],
        test.velocity[test.counted],
        command[test.counted] if isinstance(command, np.ndarray) else command,
        np.array(forces)[:, test.counted],
    )
    return replace(prediction, other_forces=np.array(forces[1:]), sets_apart=apart)


def predict_test(
    fit: Fit, test: DamperTest, observing: Observing | None = None, substep_factor: int = 1
) -> Prediction:
    """A prediction without a warning, with `substep_factor` times as many integration steps."""
    observing = observing or fit.settings.observing
    test = observed(test, observing)
    compared = ObservedTest.of(fit.spec, test, observing.of_each)
    with explain_failures(fit, test):
        force, estimated, substeps = compared.predict_force(
            np.array(fit.theta), substep_factor=substep_factor
        )
    return Prediction(
        test=test,
        model_force=force,
        seen=fit.seen(test),
        outside=fit.outside(test, force),
        substeps=substeps,
        estimated=estimated,
    )


def mean_cycle(test: DamperTest) -> float:
    """Mean number of samples in a cycle; of a record without a whole cycle all its samples."""
    cycles = whole_cycles(test.displacement)
    return (cycles[-1].stop - cycles[0].start) / len(cycles) if cycles else float(test.n_time)


def has_regular_cycles(test: DamperTest) -> bool:
    """Whether the motion is periodic, see `regular_cycles`."""
    return bool(regular_cycles(test.displacement[test.counted]))


@checked
def predict_left_out(
    tests: Sequence[DamperTest], fold: Fold, identify_rest: IdentifyRest
) -> tuple[Prediction, ...]:
    """Leave out the tests of each fold in turn, identify from the others, and predict those left out, in their order.

    A test is not predicted where the commands of the others leave a law or the rate of the driver open.

    Parameters
    ----------
    identify_rest
        Identifies from tests, `None` where these leave the damper open. It must not use the ones left out, nor start
        from a fit to them.

    Raises
    ------
    SettingError
        Where there are fewer than two folds, a test cannot be simulated by the fit to the others, or none is predicted.

    Warns
    -----
    MrworkWarning
        Where tests are not predicted.
    """
    folds = folds_of(tests, fold)
    predictions: dict[int, Prediction] = {}
    failures, left_open = list[str](), list[str]()
    for members, rest in zip(folds, rests_of(tests, folds), strict=True):
        fit = identify_rest(rest)
        if fit is None or not are_determined(fit.spec, rest):
            left_open += [tests[index].name for index in members]
            continue
        for index in members:
            try:
                predictions[index] = predict_test(fit, tests[index])
            except SimulationError as reason:
                failures.append(str(reason))
    if failures:
        raise SettingError(
            f"{len(failures)} of {len(tests)} tests cannot be predicted without themselves, first: {failures[0]}; "
            "leave out less at a time"
        )
    if left_open:
        open_remark = _LEFT_OPEN.remark(list_names(left_open), measured=Measured(len(left_open), ""))
        if not predictions:
            raise SettingError(open_remark.message)
        warn(open_remark.message, MrworkWarning, stacklevel=4)
    return tuple(predictions[index] for index in sorted(predictions))


def extremes_of(tests: Sequence[DamperTest]) -> list[list[int]]:
    """Indices of the fastest tests, of the highest and lowest frequency, and of the largest; each a group.

    A group is within a factor of 1.4 of the extreme, or within 10 % where less than half of the tests would remain.
    Without others there is no group.
    """
    ranges = [range_of_test(test, None) for test in tests]
    stroke, velocity = (np.array([getattr(each, name) for each in ranges]) for name in ("stroke", "velocity"))
    frequency = np.array([np.mean(each.frequency or 0.0) for each in ranges])
    groups = list[list[int]]()
    for extent in (velocity, frequency, 1.0 / np.maximum(frequency, _LOWEST), stroke):
        for factor, remaining in _OF_EXTREME:
            rest = extent < extent.max(initial=0.0) / factor
            if rest.any() and np.mean(rest) >= remaining:
                groups.append(np.flatnonzero(~rest).tolist())
                break
    return [group for number, group in enumerate(groups) if group not in groups[:number]]


@checked
def predict_beyond(tests: Sequence[DamperTest], identify_rest: IdentifyRest) -> tuple[Prediction, ...]:
    """Predictions of each group of extreme tests by a fit to the others, for `calibrate`.

    Tests are skipped that the others cannot predict. `identify_rest` is as for `predict_left_out`.
    """
    groups = extremes_of(tests)
    predictions = []
    for members, rest in zip(groups, rests_of(tests, groups), strict=True):
        with suppress(MrworkError):
            fit = identify_rest(rest)
            if fit is not None and are_determined(fit.spec, rest):
                predictions += [predict_test(fit, tests[index]) for index in members]
    return tuple(predictions)


def fold_groups(tests: Sequence[DamperTest], fold: Fold) -> list[list[int]]:
    """Indices of the tests of each fold; tests that are alike, as versions of one record are, share their fold."""
    commands = command_groups(tests) if fold == "command" else []

    def together(one: int, other: int) -> bool:
        if fold == "command":
            return commands[one] == commands[other]
        return fold == "motion" and are_one_motion(motion_of(tests[one]), motion_of(tests[other]))

    folds: list[list[int]] = []
    for group in alike_groups([RecordedMotion.of(test) for test in tests]):
        for members in folds:
            if together(members[0], group[0]):
                members += group
                break
        else:
            folds.append(group)
    return folds


def folds_of(tests: Sequence[DamperTest], fold: Fold) -> list[list[int]]:
    """Indices of the tests of each fold, of which there must be two."""
    folds = fold_groups(tests, fold)
    if len(folds) < 2:
        raise SettingError(
            f"to leave one {fold} out there must be two, the {len(tests)} tests given have one {fold} in common; "
            "give tests that differ in it"
        )
    return folds


def rests_of(tests: Sequence[DamperTest], folds: Sequence[Sequence[int]]) -> list[tuple[DamperTest, ...]]:
    """The tests that remain without each fold."""
    return [tuple(test for index, test in enumerate(tests) if index not in members) for members in folds]


def alike_tests(tests: Sequence[DamperTest]) -> Iterator[Remark]:
    """Note which tests have the motion and command of another and are left out with it."""
    motions = [RecordedMotion.of(test) for test in tests]
    pairs = [
        like
        for members in alike_groups(motions)
        for index in members[1:]
        if (like := likest(motions[index], [motions[other] for other in members if other != index]))
    ]
    if pairs:
        yield _LEFT_OUT_TOGETHER.remark(likenesses_in_words(pairs))


def are_one_motion(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether strokes and lengths of a cycle agree within 15 %."""
    pairs = zip(one, other, strict=True)
    return all(abs(first - second) <= _SAME_MOTION * max(first, second) for first, second in pairs)


def motion_of(test: DamperTest) -> tuple[float, float]:
    """Stroke [m] and mean length of a cycle [s]."""
    return float(np.ptp(test.displacement[test.counted])), mean_cycle(test) * test.dt


def halves(test: DamperTest) -> tuple[DamperTest, DamperTest]:
    """First half of the cycles, to fit; and the whole record with only the second half counted, to predict."""
    counted = [cycle for cycle in whole_cycles(test.displacement) if cycle.start >= test.n_settle]
    middle = test.n_settle + (test.n_time - test.n_settle) // 2
    if len(counted) > 1:
        middle = counted[len(counted) // 2].start
    return test.part(0, middle), replace(test, n_settle=middle)


def cycles_of_halves(test: DamperTest) -> tuple[DamperTest, ...]:
    """First half of the cycles, to fit; and for each later one the record to its end, of which it alone counts."""
    first, second = halves(test)
    cycles = [cycle for cycle in whole_cycles(test.displacement) if cycle.start >= second.n_settle]
    later = [
        replace(test.part(0, cycle.stop), name=f"{test.name}, cycle {number}", n_settle=cycle.start)
        for number, cycle in enumerate(cycles, start=1)
    ]
    return first, *(later or [second])
