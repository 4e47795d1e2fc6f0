"""The observation model of a test: what rig and processing make of the force of the damper.

An effect is given as a number, or free: one number of all tests, which a fit finds with the parameters; or it is a
nuisance of each test, estimated from the force of that test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, isfinite, nan
from typing import Annotated, Any, Final, TypeAlias

import numpy as np

from mrwork.base.arguments import AnyNumbers, Positive, Samples, checked
from mrwork.base.hints import InUnit, Within
from mrwork.base.keys import closest
from mrwork.base.values import Floats
from mrwork.errors import SettingError


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect on the recorded force: its name in settings, the field of `Observation`, its unit, and its words.

    One that may be free has a range, outside of which no rig is; one that may be estimated for each test is `of_each`.
    One `of_time` may be given as a share of a period.
    """

    name: str
    field: str
    unit: str
    words: str
    of_time: bool = False
    free: tuple[float, float] | None = None
    of_each: bool = False

    @property
    def parameter(self) -> str:
        """Name among the parameters of a fit that has found it."""
        return f"force_{self.name}"


_LONGEST_DELAY = 0.5
EFFECTS: Final = {
    effect.name: effect
    for effect in (
        Effect("mass", "mass", "kg", "plus the inertia of {:.4g} kg", free=(0.0, 5e3)),
        Effect(
            "delay",
            "delay_seconds",
            "s",
            "late by {:.3g} s",
            of_time=True,
            free=(-_LONGEST_DELAY, _LONGEST_DELAY),
            of_each=True,
        ),
        Effect("lag", "lag_seconds", "s", "lagging by {:.3g} s", of_time=True, free=(0.0, _LONGEST_DELAY)),
        Effect("lowpass", "lowpass_hz", "Hz", "low-passed at {:.3g} Hz"),
        Effect("average", "average_seconds", "s", "averaged over {:.3g} s", of_time=True),
        Effect("gain", "gain", "1", "times {:.4g}", of_each=True),
        Effect("offset", "offset", "N", "offset by {:.4g} N", of_each=True),
    )
}
"""The effects by name, in the order in which they act."""

_Seconds = Annotated[float, Within(least=0.0, most=1e6), InUnit("s")]


@checked
class Observation:
    """Effects of rig and processing on the recorded force, in this order; the default has no effect.

    Inertia of a `mass` [kg] that moves between damper and load cell; delay of `delay_seconds`; first-order lag of the
    time constant `lag_seconds`; causal second-order Butterworth low-pass filter at `lowpass_hz` (0 for none); centred
    moving average over `average_seconds`; factor `gain`; `offset` [N]. The model is applied to simulated forces before
    the comparison, never to the record.
    """

    delay_seconds: Annotated[float, Within(least=-1e6, most=1e6), InUnit("s")] = 0.0
    lowpass_hz: Annotated[float, Within(least=0.0, most=1e6), InUnit("Hz")] = 0.0
    average_seconds: _Seconds = 0.0
    gain: Annotated[float, Within(least=-1e6, most=1e6)] = 1.0
    offset: Annotated[float, Within(least=-1e9, most=1e9), InUnit("N")] = 0.0
    lag_seconds: _Seconds = 0.0
    mass: Annotated[float, Within(least=-1e6, most=1e6), InUnit("kg")] = 0.0

    def __post_init__(self) -> None:
        if self.gain == 0.0:
            raise SettingError("the gain of an observation is 0, which records nothing; give another")

    @property
    def in_words(self) -> str:
        """Description in words; empty for the default."""
        return ", ".join(
            effect.words.format(value)
            for effect in EFFECTS.values()
            if (value := getattr(self, effect.field)) != getattr(AS_IT_IS, effect.field)
        )

    @checked
    def reach(self, dt: Positive) -> tuple[int, int]:
        """Numbers of samples at the start and at the end of a record for which the force beyond it would be needed.

        `observe` holds the force constant there, and truncates the window of the average.
        """
        half, delay = 0.5 * self.average_seconds / dt, self.delay_seconds / dt
        before, after = half + max(delay, 0.0), half + max(-delay, 0.0)
        return ceil(before - _ROUNDED_SAMPLES), ceil(after - _ROUNDED_SAMPLES)

    @checked
    def observe(self, force: AnyNumbers, dt: Positive, acceleration: Samples | None = None) -> Floats:
        """Recorded force for a damper force [N], shape (..., n_time), sampled every `dt` [s].

        With a `mass` the `acceleration` [m/s^2] of the motion is needed, shape (n_time,).
        """
        if force.ndim < 1 or force.shape[-1] < 2:
            raise SettingError(f"`force` has shape {force.shape}; give two samples or more")
        if self.mass != 0.0 and acceleration is None:
            raise SettingError("an observation with a `mass` needs the `acceleration` of the motion; give it")
        observed: Floats = observe_by(self, _filtered, force, dt, acceleration)
        return observed


def observe_by(model: Observation, filtered: Filter, force: Any, dt: float, acceleration: Any) -> Any:
    """As `Observation.observe`, for an array of NumPy or JAX, with the filter of that library."""
    observed = force
    if model.mass != 0.0:
        observed = observed + model.mass * acceleration
    if model.delay_seconds != 0.0:
        observed = delay_signal(observed, model.delay_seconds / dt)
    if model.lag_seconds > 0.0:
        observed = _lagged(filtered, observed, model.lag_seconds / dt)
    if model.lowpass_hz > 0.0:
        observed = _low_passed(filtered, observed, model.lowpass_hz, dt)
    if model.average_seconds > 0.0:
        observed = average_signal(observed, model.average_seconds / dt)
    if model.gain != 1.0:
        observed = model.gain * observed
    return observed + model.offset if model.offset != 0.0 else observed


AS_IT_IS = Observation()
# Length of a moving average [samples] below which it changes less than its sums are rounded.
_SHORTEST_AVERAGE = 1e-3
# Samples by which a window may exceed a whole number of them by rounding.
_ROUNDED_SAMPLES = 1e-6
# Least corner of a filter per sampling frequency, below which its equations are singular to rounding.
_LOWEST = 1e-7


# Signals are arrays of NumPy or JAX.
def delay_signal(signal: Any, samples: float) -> Any:
    """Delay a signal, shape (..., n_time), by `samples`, linear in between; the ends are held constant."""
    last = signal.shape[-1] - 1
    position = np.clip(np.arange(last + 1) - samples, 0.0, last)
    before = np.minimum(np.floor(position).astype(int), last - 1)
    share = position - before
    return signal[..., before] * (1.0 - share) + signal[..., before + 1] * share


def average_signal(signal: Any, samples: float) -> Any:
    """Moving average of a signal, shape (..., n_time), linear between samples, over a centred window of `samples`.

    At the ends, the window is truncated to the record.
    """
    if samples < _SHORTEST_AVERAGE:
        return signal
    xp, last = signal.__array_namespace__(), signal.shape[-1] - 1
    change = xp.diff(signal, axis=-1)
    middles = signal[..., 1:] + signal[..., :-1]
    middles *= 0.5
    integral = xp.cumulative_sum(middles, axis=-1, include_initial=True)

    def integral_at(offset: float) -> Any:
        # Every sample is as far from the one before it, so that slices do, which are many times as fast as indices.
        before = floor(offset)
        first = min(max(0, -before), last + 1)
        stop = min(max(last - before, first), last + 1)
        share, within = offset - before, slice(first + before, stop + before)
        inside = change[..., within] * (0.5 * share)
        inside += signal[..., within]
        inside *= share
        inside += integral[..., within]
        nothing, whole = integral[..., :1], integral[..., -1:]
        head = xp.broadcast_to(nothing, (*nothing.shape[:-1], first))
        tail = xp.broadcast_to(whole, (*whole.shape[:-1], last + 1 - stop))
        return xp.concat([head, inside, tail], axis=-1)

    half = 0.5 * samples
    place = np.arange(last + 1)
    average = integral_at(half) - integral_at(-half)
    average /= np.minimum(place + half, last) - np.maximum(place - half, 0.0)
    return average


Filter = Callable[[Floats | list[float], Floats | list[float], Any, Any], Any]
"""Numerator, denominator, signal and the state per value of a constant signal to the filtered signal, from rest."""


def _filtered(
    numerator: Floats | list[float], denominator: Floats | list[float], signal: Floats, _: Any
) -> Floats:
    # `scipy.signal.lfilter` does the same; its import takes as long as a fit.
    from scipy.linalg.lapack import dtbtrs

    rows = signal.reshape(-1, signal.shape[-1])
    driven = numerator[0] * rows
    for order in range(1, len(denominator)):
        driven[:, order:] += numerator[order] * rows[:, :-order]
        # A constant signal before the record has passed unchanged.
        driven[:, :order] += (numerator[order] - denominator[order]) * rows[:, :1]
    bands = np.empty((len(denominator), rows.shape[1]), order="F")
    bands[:] = np.reshape(denominator, (-1, 1))
    solved, _ = dtbtrs(bands, driven.T, uplo="L", diag="U")
    return np.asarray(solved.T.reshape(signal.shape))


def _lagged(filtered: Filter, signal: Any, samples: float) -> Any:
    """Response of `samples y' + y = signal`, exact for a signal that is linear between samples and constant before."""
    decay = np.exp(-1.0 / samples)
    mean = -np.expm1(-1.0 / samples) * samples
    return filtered([1.0 - mean, mean - decay], [1.0, -decay], signal, mean)


def _low_passed(filtered: Filter, signal: Any, corner_hz: float, dt: float) -> Any:
    from scipy.signal import butter, lfilter_zi  # slow to load and rarely needed

    if corner_hz * dt >= 0.5:
        return signal
    if corner_hz * dt < _LOWEST:
        raise SettingError(
            f"a low-pass filter at {corner_hz:g} Hz has no effect in a step of {dt:g} s; give a higher frequency"
        )
    numerator, denominator = butter(2, 2.0 * corner_hz * dt)
    return filtered(numerator, denominator, signal, lfilter_zi(numerator, denominator))


DETECT: Final = "detect"
NONE: Final = "none"
FREE: Final = "free"
EACH: Final = "each"
WEIGH: Final = "weigh"
_GIVEN: Final = "given"


@dataclass(frozen=True, slots=True, kw_only=True)
class Clause:
    """A word of a user: how an effect is observed, its value in SI or in periods; `detect` and `weigh` name none."""

    word: str
    how: str
    effect: Effect | None = None
    value: float = 0.0
    in_periods: bool = False

    @classmethod
    def of(cls, word: str) -> Clause:
        """The clause of a word, checked: `detect`, `none`, `weigh`, WHAT=VALUE, WHAT=free or WHAT=each."""
        if word in (DETECT, NONE, WEIGH):
            return cls(word=word, how=word)
        name, _, text = word.partition("=")
        if (effect := EFFECTS.get(name)) is None:
            near = closest(name, [DETECT, NONE, WEIGH, *EFFECTS])
            values = ", ".join(f"{key}=VALUE" for key in EFFECTS)
            cure = f", did you mean {near}" if near else f"; give {DETECT}, {NONE}, {WEIGH}, or {values}"
            raise SettingError(f"--observe is {word!r}{cure}")
        if text in (FREE, EACH):
            able = [other for other in EFFECTS.values() if (other.free if text == FREE else other.of_each)]
            if effect not in able:
                raise SettingError(
                    f"--observe is {word!r}, and no fit tells {name} from the force of the damper; give its value; "
                    f"what may be {text} is {' or '.join(other.name for other in able)}"
                )
            return cls(word=word, how=text, effect=effect)
        share = text.endswith("T") and effect.of_time
        try:
            value = float(text[:-1] if share else text)
        except ValueError:
            value = nan
        if not isfinite(value):
            raise SettingError(f"{text!r} in --observe {word} is not a number; write it as 0.002, or 0.1T")
        clause = cls(word=word, how=_GIVEN, effect=effect, value=value, in_periods=share)
        clause.given(lambda: 1.0)
        return clause

    def given(self, period: Callable[[], float]) -> dict[str, float]:
        """The value that it gives a field of an observation, of a test with this dominant period [s]."""
        if self.effect is None or self.how != _GIVEN:
            return {}
        values = {self.effect.field: self.value * period() if self.in_periods else self.value}
        try:
            Observation(**values)
        except SettingError as reason:
            raise SettingError(f"--observe is {self.word!r}: {reason}") from None
        return values


@dataclass(frozen=True, slots=True, kw_only=True)
class Observing:
    """What sensors do to the force of tests that have no observation of their own; `of` reads what a user writes."""

    clauses: tuple[Clause, ...]

    @classmethod
    def of(cls, observe: Observe) -> Observing:
        """What the words of a user mean, checked; effects that are all left to the fit leave `detect`, too."""
        if isinstance(observe, Observing):
            return observe
        words = (observe,) if isinstance(observe, str) else tuple(observe)
        if not words or (NONE in words and len(words) > 1):
            raise SettingError(
                f"--observe is {' and '.join(words) or 'empty'}; give {DETECT}, {NONE} alone, or WHAT=VALUE"
            )
        clauses = [Clause.of(word) for word in words]
        names = [clause.how if clause.effect is None else clause.effect.name for clause in clauses]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise SettingError(f"--observe gives {twice} twice; give it once")
        return cls._with(clauses)

    @classmethod
    def _with(cls, clauses: Sequence[Clause]) -> Observing:
        if not clauses:
            return cls(clauses=(Clause.of(NONE),))
        if all(clause.how in (WEIGH, FREE, EACH) for clause in clauses):
            return cls(clauses=(Clause.of(DETECT), *clauses))
        return cls(clauses=tuple(clauses))

    @property
    def words(self) -> list[str]:
        """As users write it, for records and JSON."""
        return [clause.word for clause in self.clauses]

    def __repr__(self) -> str:
        return repr(tuple(self.words))

    @property
    def detects(self) -> bool:
        """Whether an average that was found in the force of a record is the model's, too."""
        return self._has(DETECT)

    @property
    def weighs(self) -> bool:
        """Whether a fit tries which effects pay."""
        return self._has(WEIGH)

    @property
    def free(self) -> tuple[Effect, ...]:
        """The effects that are fitted with the parameters, one number each for all tests."""
        return self._left(FREE)

    @property
    def of_each(self) -> tuple[Effect, ...]:
        """The effects that are estimated for each test from its own force."""
        return self._left(EACH)

    @property
    def to_fit(self) -> Observing:
        """What is left to a fit of all tests, alone."""
        return self._with([clause for clause in self.clauses if clause.how in (WEIGH, FREE)])

    def given(self, period: Callable[[], float]) -> dict[str, float]:
        """Values by the fields of an observation, of a test with this dominant period [s], asked for where needed."""
        return {name: value for clause in self.clauses for name, value in clause.given(period).items()}

    def with_effects(self, values: Mapping[Effect, float | None]) -> Observing:
        """With these effects given, or free where there is no value, whatever is said of them here."""
        others = [
            clause
            for clause in self.clauses
            if clause.how not in (NONE, WEIGH) and clause.effect not in values
        ]
        given = [
            Clause(word=f"{effect.name}={FREE}", how=FREE, effect=effect)
            if value is None
            else Clause(word=f"{effect.name}={value}", how=_GIVEN, effect=effect, value=value)
            for effect, value in values.items()
        ]
        return self._with([*others, *given])

    def _has(self, how: str) -> bool:
        return any(clause.how == how for clause in self.clauses)

    def _left(self, how: str) -> tuple[Effect, ...]:
        left = [clause.effect for clause in self.clauses if clause.how == how]
        return tuple(effect for effect in EFFECTS.values() if effect in left)


Observe: TypeAlias = Observing | str | Sequence[str]
"""What a user writes, one word or several, or what was read of it."""
AS_RECORDED: Final = Observing.of(NONE)
