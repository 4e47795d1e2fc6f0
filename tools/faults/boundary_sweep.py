"""A sweep of the compiled module with arguments of any kind: `python -m tools.faults.boundary_sweep COUNT`.

A call returns, or is refused with a sentence. It may also be stopped: what is asked for may be possible, but long.
"""

from __future__ import annotations

import faulthandler
import resource
import signal
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from boundary_calls import CALLS, REFUSALS, Call, leaves, unaligned, with_part
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mrwork import _rust

# Seconds after which a call is stopped, and memory [bytes]; whoever asks for more by mistake is refused, not killed.
_LONGEST = 0.5
_MEMORY = 6 << 30

Draw = Callable[[st.SearchStrategy[Any]], Any]

NUMBERS = [0.0, -0.0, -1.0, 1e-3, 5e-324, 1e-300, 1e300, 1.7e308, np.nan, np.inf, -np.inf]
WHOLE = [
    0,
    1,
    -1,
    2,
    3,
    255,
    256,
    2**31,
    2**32 - 1,
    2**32,
    2**61,
    2**62,
    2**63,
    2**64 - 1,
    2**64,
    -(2**63),
    10**30,
]
TEXTS = ["", "linear", "constant", "x" * 100_000, "\0", "\ud800", "spencer"]
OBJECTS = [
    None,
    True,
    object(),
    [],
    (),
    {},
    "text",
    b"bytes",
    1,
    1.5,
    1j,
    np.float64(1.0),
    np.int64(3),
    type,
    [None],
    [[]],
]
DTYPES = ["f4", "f2", "i8", "u4", "u8", "u1", "?", "c16", "O", "U3", "M8[s]", ">f8", ">u4", "g"]


class StoppedError(Exception):
    """A call that took too long."""


def stop(*_: object) -> None:
    raise StoppedError


def one_of(draw: Draw, values: Sequence[Any]) -> Any:
    """One of values that need not be hashable."""
    return values[draw(st.integers(0, len(values) - 1))]


def other_array(draw: Draw, array: np.ndarray) -> Any:
    """An array that differs in shape, layout, kind or numbers."""
    kind = draw(st.integers(0, 9))
    axes = list(array.shape)
    if kind == 0:
        return array.astype(one_of(draw, DTYPES))
    if kind == 1:
        axes[draw(st.integers(0, len(axes) - 1))] = one_of(draw, [0, 1, 2, 3, 5, 17, 1000])
        return np.resize(array, axes) if array.size else np.zeros(axes, dtype=array.dtype)
    if kind == 2:
        # No memory is taken, whatever the shape.
        axes[draw(st.integers(0, len(axes) - 1))] = one_of(draw, [2**20, 2**31, 2**40])
        return np.lib.stride_tricks.as_strided(
            np.zeros(1, dtype=array.dtype), shape=axes, strides=[0] * len(axes), writeable=False
        )
    if kind == 3:
        return one_of(draw, [np.asfortranarray(array), array[::-1], np.repeat(array, 2, axis=-1)[..., ::2]])
    if kind == 4:
        return one_of(draw, [array[None], array.ravel(), array[..., None], np.array(1.0), array.T])
    if kind == 5:
        return unaligned(array)
    if kind == 6:
        locked = array.copy()
        locked.flags.writeable = False
        return locked
    if kind == 7 and array.size:
        changed = array.copy()
        numbers = NUMBERS if array.dtype.kind == "f" else [0, 1, np.iinfo(array.dtype).max]
        for _ in range(draw(st.integers(1, 3))):
            changed.flat[draw(st.integers(0, array.size - 1))] = one_of(draw, numbers)
        return changed
    if kind == 8:
        # Two axes of nothing and of very many.
        huge = np.lib.stride_tricks.as_strided(
            np.zeros(1, dtype=array.dtype),
            shape=[0, *[2**29] * (len(axes) - 1)],
            strides=[0] * len(axes),
            writeable=False,
        )
        return huge if draw(st.booleans()) else np.zeros([0] * len(axes), dtype=array.dtype)
    return one_of(draw, [array.tolist(), np.ma.masked_array(array), memoryview(array), *OBJECTS])


def other(draw: Draw, value: Any) -> Any:
    """Another value in place of one that is accepted."""
    if draw(st.integers(0, 7)) == 0:
        return one_of(draw, [*OBJECTS, *WHOLE, *NUMBERS, *TEXTS])
    if isinstance(value, np.ndarray) and value.ndim and value.size < 10_000 and value.dtype.char in "dILQ":
        return other_array(draw, value)
    if isinstance(value, (list, tuple)):
        n_kept = draw(st.integers(0, len(value)))
        return type(value)([*value[:n_kept], *(value[:1] * one_of(draw, [0, 1, 2, 100]))])
    if isinstance(value, str):
        return one_of(draw, [*TEXTS, value + "x"])
    return one_of(draw, [*WHOLE, *NUMBERS])


def calls() -> dict[str, Call]:
    history = _rust.LoadingHistory(0.01, np.sin(np.arange(8.0)))
    # Arguments that have a default.
    batch = {"laws": None, "lagged": False, "substep_factor": 1, "threads": 1}
    more: dict[str, dict[str, Any]] = {
        "misfits": {**batch, "first": 0},
        "force_histories": batch,
        "sensitivities": {**batch, "columns": [0, 1]},
        "riccati_equations": {"threads": 1},
        "respond": {"threads": 1, "step_factor": 1},
    }
    known = {
        name: Call(function=call.function, arguments={**call.arguments, **more.get(name, {})}, free={})
        for name, call in CALLS.items()
    }
    return {
        **known,
        "stages": Call(function=history.stages, arguments={"substeps": 2}, free={}),
        "fma_peak": Call(function=_rust.fma_peak, arguments={"threads": 1, "seconds": 0.0}, free={}),
    }


KNOWN = calls()
COUNTS: Counter[str] = Counter()


@st.composite
def odd_calls(draw: st.DrawFn) -> tuple[str, dict[str, Any]]:
    name = one_of(draw, sorted(KNOWN))
    arguments = dict(KNOWN[name].arguments)
    for _ in range(one_of(draw, [1, 1, 2, 3])):
        argument = one_of(draw, sorted(arguments))
        place, value = one_of(draw, list(leaves(arguments[argument])))
        arguments[argument] = with_part(arguments[argument], place, other(draw, value))
    if (
        name == "fma_peak"
        and isinstance(arguments["seconds"], (int, float))
        and 0.0 < arguments["seconds"] <= 60.0
    ):
        arguments["seconds"] = 0.0
    return name, arguments


def check(call: tuple[str, dict[str, Any]]) -> None:
    name, arguments = call
    try:
        # A signal that comes late is still caught below.
        try:
            signal.setitimer(signal.ITIMER_REAL, _LONGEST)
            KNOWN[name].function(**arguments)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        COUNTS["accepted"] += 1
    except StoppedError:
        COUNTS["stopped"] += 1
    except REFUSALS as error:
        COUNTS["refused" if str(error).strip() else "refused without a sentence"] += 1


def main() -> None:
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    signal.signal(signal.SIGALRM, stop)
    healthy = [HealthCheck.too_slow, HealthCheck.data_too_large]
    sweep = settings(
        max_examples=int(sys.argv[1]),
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=healthy,
    )
    sweep(given(odd_calls())(check))()
    print(" ".join(f"{count} {what}" for what, count in sorted(COUNTS.items())))


if __name__ == "__main__":
    main()
