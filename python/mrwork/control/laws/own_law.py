"""A control law of the user for one run, with memory and settings by name, beside the laws of the registry."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import Positive, checked
from mrwork.base.keys import key
from mrwork.control.laws.control_law import ControlLaw, ControlLawSpec, GainSpec, add_own_law
from mrwork.control.laws.law_problem import Design, DesignProblem, LawSettings, Span
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.laws.own_formula import OwnFormula, RowsCommand
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.store.codec import digest_of
from mrwork.store.user_python import place_of, text_to_compare

Given = tuple[str, float, float | ArrayLike, float]
"""Unit, lower bound, nominal value or values, and upper bound of a setting."""


@checked
def own_law(
    function: Callable[..., Any],
    *,
    memory: Mapping[str, bool | ArrayLike] | None = None,
    settings: Mapping[str, Given] | None = None,
    name: str = "",
    title: str = "",
    rms_time: Positive | None = None,
    record: bool | None = None,
) -> ControlLaw:
    """Return a control law of your own, for everything that takes a law of the registry.

    It is written for one run, and recorded as operations of the core: it runs, is tuned and is printed as C as a law of
    the registry is. Where it cannot be recorded it is called in Python for each run at each sample, and a remark of the
    responses says why.

    Parameters
    ----------
    function
        ``function(sample, memory, settings)``, which returns the command of each device, shape (n_devices,), or one
        number for one device; in NumPy. `sample` has the readings of `LoopSample` without the axis of runs, as
        `sample.rate[0]`, and the time from sample to sample as `sample.sample_time` [s]. What it keeps it writes to
        `memory`, as ``memory.v = ...``.
    memory
        Names of what a run keeps from sample to sample, with the value at the start: numbers, or arrays whose shape
        they keep.
    settings
        Unit, lower bound, nominal value and upper bound of each setting, as ``{"gain": ("A s/m", 0.1, 6.0, 100.0)}``;
        `settings.gain` is its value. A setting whose nominal value is an array has that shape, and is a row of numbers
        in gains and tables. `tune` searches within the bounds, on a logarithmic scale where the lower one is positive.
    name, title
        Name of the law, by default that of the function, and its name in tables.
    rms_time
        Time constant of the running root mean squares `sample.rms` [s].
    record
        `True` refuses a law that cannot be recorded, `False` calls it in Python, as to print what it does.

    Returns
    -------
    ControlLaw
        The law with its nominal settings. `dataclasses.replace(law, gains={"gain": [[2.0], [4.0]]})` has a row for each
        candidate.

    Raises
    ------
    SettingError
        If a bound, a nominal value or a name is none.

    Examples
    --------
    >>> import numpy as np
    >>> import mrwork as mr
    >>> def brake(sample, memory, settings):
    ...     return settings.gain * np.abs(sample.rate)
    >>> law = mr.own_law(brake, settings={"gain": ("A s/m", 0.1, 6.0, 100.0)})
    >>> frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    >>> damper = mr.Device(
    ...     name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    ... )
    >>> mr.simulate_loop(frame, [damper], law, [mr.synthetic_motion(duration=2.0)]).shape
    (1, 1, 1)
    """
    name = name or getattr(function, "__name__", type(function).__name__)
    kept = {each: _start_of(name, each, start) for each, start in (memory or {}).items()}
    declared = {each: _checked_setting(name, each, given) for each, given in (settings or {}).items()}
    for each in (*kept, *declared):
        if not each.isidentifier():
            raise SettingError(f"{name} has a setting or memory {each!r}; give it a name of letters, as gain")
    if taken := [each for each in declared if hasattr(_OwnSettings, each)]:
        raise SettingError(
            f"{taken[0]} is no name of a setting of {name}; give another one, as {taken[0]}_of_law"
        )
    formula = OwnFormula(
        name=name,
        function=function,
        rows=_Rows(kept, {each: np.shape(nominal) for each, (_, _, nominal, _) in declared.items()}),
        start=np.concatenate([np.zeros(0), *(start.ravel().astype(np.float64) for start in kept.values())]),
        names=tuple(
            f"{each}[{place}]"
            for each, (_, _, nominal, _) in declared.items()
            for place in range(np.size(nominal))
        ),
        rms_time=rms_time,
        given=", ".join(
            f"{argument}={value!r}"
            for argument, value in {
                "memory": {each: start.tolist() for each, start in kept.items()},
                "settings": declared,
                "name": name,
                "title": title,
                "rms_time": rms_time,
                "record": record,
            }.items()
            if value
        ),
        record=record,
    )
    digest = digest_of(
        name,
        rms_time,
        record,
        text_to_compare(function),
        {each: start.tolist() for each, start in kept.items()},
        declared,
    )
    return _registered(formula, f"{name}_{digest[:8]}", title or name.replace("_", " "), declared)


def _start_of(law: str, name: str, start: ArrayLike) -> NDArray[Any]:
    """What a law keeps at the start: truths, or numbers."""
    kept = np.array(start)
    if kept.dtype.kind not in "biuf":
        raise SettingError(
            f"memory.{name} of {law} begins as {start!r}; give a number, a truth or an array of them"
        )
    return kept if kept.dtype.kind == "b" else kept.astype(np.float64)


def _checked_setting(law: str, name: str, given: Sequence[Any]) -> Given:
    unit, lower, nominal, upper = given
    numbers = np.asarray(nominal, dtype=np.float64)
    if not (isinstance(unit, str) and unit):
        raise SettingError(f"{name} of {law} has no unit; give one, as 1 for a number without")
    within = numbers.size > 0 and bool(((lower <= numbers) & (numbers <= upper)).all())
    if not (lower < upper and within and math.isfinite(lower) and math.isfinite(upper)):
        outside = numbers[~((lower <= numbers) & (numbers <= upper))]
        told = f"{outside[0]:g}" if outside.size else f"{numbers.ravel()[0]:g}" if numbers.size else "nothing"
        raise SettingError(
            f"{name} of {law} is from {lower:g} to {upper:g} and nominally {told}; give a lower bound, a nominal "
            "value and an upper bound that rise"
        )
    return unit, float(lower), numbers.tolist(), float(upper)


def _registered(formula: OwnFormula, name: str, title: str, declared: Mapping[str, Given]) -> ControlLaw:
    """The law with its nominal settings, found by its name from now on."""
    words = inspect.getdoc(formula.function) or title
    equation, _, _ = words.partition("\n")
    add_own_law(
        ControlLawSpec(
            name=name,
            title=title,
            equation=equation,
            description=words,
            source=f"law of the user, {place_of(formula.function) or 'in Python'}",
            gains=tuple(
                GainSpec(
                    name=each,
                    unit=unit,
                    is_command=False,
                    scales_with_command=False,
                    shape="loop",
                    numbers=np.size(nominal),
                    description=f"setting of {title}, from {lower:g} to {upper:g}",
                )
                for each, (unit, lower, nominal, upper) in declared.items()
            ),
            tables=(),
            needs_curve=False,
            needs_model=False,
            commands_force=False,
            reads_acceleration=False,
            reads_sprung=False,
            # Nobody knows whether it does.
            switches=True,
            own=formula,
        )
    )
    SETTINGS[name] = _settings_class(title, declared)
    return ControlLaw(
        name=name, gains={each: np.ravel(nominal).tolist() for each, (_, _, nominal, _) in declared.items()}
    )


def own_law_of_rows(formula: OwnFormula, source: str) -> ControlLaw:
    """The law of a function for rows of runs, without settings, where a law with a specification is asked for."""
    name = f"{formula.name}_{(source or digest_of(text_to_compare(formula.function)))[:8]}"
    return _registered(formula, name, formula.name.replace("_", " "), {})


class _OwnSettings(LawSettings):
    """Settings of a law of the user: each is a gain of the loop, with as many numbers as its nominal value."""

    __slots__ = ()
    sizes: ClassVar[Mapping[str, int]] = {}

    def design(self, problem: DesignProblem) -> Design:
        """The settings as they are."""
        gains = {
            name: np.ravel(getattr(self, name)).astype(np.float64) for name in type(self).__annotations__
        }
        for name, numbers in gains.items():
            if len(numbers) != type(self).sizes[name]:
                raise InvalidSettingError(
                    name, f"{name} has {len(numbers)} numbers; give {type(self).sizes[name]}"
                )
        return Design(gains=gains)


def _settings_class(title: str, declared: Mapping[str, Given]) -> type[LawSettings]:
    fields, kinds = {}, {}
    for name, (unit, lower, nominal, upper) in declared.items():
        entries = (*np.ravel(nominal).tolist(),)
        is_array = np.ndim(nominal) > 0
        kinds[name] = tuple[float, ...] if is_array else float
        fields[name] = key(
            f"setting of {title}",
            unit="" if unit == "1" else unit,
            least=lower,
            most=upper,
            default=entries if is_array else entries[0],
            span=Span(
                lower=lower,
                upper=upper,
                start=None if is_array else entries[0],
                scale="log" if lower > 0.0 else "linear",
                entries=entries if is_array else (),
            ),
        )
    namespace = {
        "__annotations__": kinds,
        "__doc__": f"{title}, a law of the user.",
        "sizes": {name: np.size(nominal) for name, (_, _, nominal, _) in declared.items()},
        **fields,
    }
    made: type[LawSettings] = checked(type("OwnSettings", (_OwnSettings,), namespace))
    return made


@dataclass(frozen=True, slots=True)
class _Rows:
    """Makes of a law for one run one for rows of runs."""

    kept: Mapping[str, NDArray[Any]]
    shapes: Mapping[str, tuple[int, ...]]

    def __call__(self, function: Callable[..., Any]) -> RowsCommand:
        """The law for rows."""

        def command(sample: Any, memory: Any, settings: Any) -> Any:
            rows = []
            for run in range(len(memory)):
                kept = SimpleNamespace(**dict(self._unpacked(memory[run])))
                own = SimpleNamespace(**dict(self._named(settings[run])))
                sent = function(_OneRun(sample, run), kept, own)
                self._pack(memory, run, kept)
                rows.append(np.reshape(sent, (-1,)) if np.ndim(sent) == 0 else sent)
            return np.stack(rows)

        return command

    def _named(self, settings: Any) -> Iterator[tuple[str, Any]]:
        place = 0
        for name, shape in self.shapes.items():
            count = math.prod(shape)
            yield name, settings[place : place + count].reshape(shape) if shape else settings[place]
            place += count

    def _unpacked(self, numbers: Any) -> Iterator[tuple[str, Any]]:
        place = 0
        for name, start in self.kept.items():
            part = numbers[place : place + start.size]
            # What is changed in place must not change the memory before its time.
            value = part.reshape(start.shape).copy() if start.ndim else part[0]
            yield name, value > 0.0 if start.dtype.kind == "b" else value
            place += start.size

    def _pack(self, memory: Any, run: int, kept: SimpleNamespace) -> None:
        if unknown := vars(kept).keys() - self.kept.keys():
            names = ", ".join(self.kept) or "none"
            raise SettingError(f"memory.{min(unknown)} is not declared; the memory has {names}")
        place = 0
        for name, start in self.kept.items():
            value = getattr(kept, name)
            if np.shape(value) != start.shape:
                raise SettingError(
                    f"memory.{name} has shape {start.shape} at first and {np.shape(value)} after; keep its shape"
                )
            memory[run, place : place + start.size] = np.reshape(value, (-1,))
            place += start.size


class _OneRun:
    """The sample of one run: the readings of `LoopSample` without the axis of runs."""

    __slots__ = ("_run", "_sample")

    def __init__(self, sample: Any, run: int) -> None:
        self._sample, self._run = sample, run

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._sample, name)
        if name in ("time", "sample_time", "largest"):
            return value
        return _OneRun(value, self._run) if name == "rms" else value[self._run]
