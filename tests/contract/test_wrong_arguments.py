"""Public functions with one wrong argument: of another kind, shape, length, size, range or name.

Each call ends in an error of ours whose text is one line, or in a result, and soon.
"""

from __future__ import annotations

import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import matplotlib.pyplot as plt
import pytest
import valid_calls_dampers
import valid_calls_design
import valid_calls_fits
import valid_calls_loop
import valid_calls_plots
from wrong_arguments import Calls, ValidCall, smallest, wrong

from mrwork.errors import MistakesError, MrworkError, MrworkWarning

ROOMS = (
    *valid_calls_dampers.ROOMS,
    *valid_calls_design.ROOMS,
    *valid_calls_fits.ROOMS,
    *valid_calls_loop.ROOMS,
    *valid_calls_plots.ROOMS,
)
# A refusal takes milliseconds; what takes this long would run for hours.
SECONDS = 20.0
# Calls that are refused as they are: they would take long, or need more than a test has.
REFUSED = {
    *(
        "read_test_table",
        "Fit.reading",
        "profile",
        "choose_model",
        "choose_laws",
        "read_building",
        "read_system",
        "study_score",
    ),
    *("read_study", "read_results", "read_tuning", "load", "run_study", "tune", "with_tuned_law"),
}


@pytest.fixture(autouse=True)
def _figures_are_closed() -> Iterator[None]:
    yield
    plt.close("all")


@contextmanager
def soon() -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError(f"longer than {SECONDS:g} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def said(valid: ValidCall, **changed: Any) -> str:
    """What is wrong with how a call ends; empty where nothing is."""
    try:
        with soon():
            valid.function(**{**valid.arguments, **changed})
    except MrworkError as error:
        # Of several mistakes of a study each has a line.
        told = error.mistakes if isinstance(error, MistakesError) else (error,)
        return "" if all(str(each).isprintable() for each in told) else f"not one line: {error!r}"
    except Exception as error:
        return repr(error)
    return ""


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.__name__)
@pytest.mark.parametrize(
    ("others", "warned"),
    [
        # Overflows of absurd numbers; what is said in them is not asked here.
        pytest.param(wrong, "ignore", id="in_a_sentence"),
        pytest.param(smallest, "error", id="without_a_warning_of_numpy"),
    ],
)
def test_a_wrong_argument_is_refused_or_accepted(
    room: Callable[[Path], Calls],
    others: Callable[[Any], Iterator[tuple[str, Any]]],
    warned: Literal["ignore", "error"],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    broken = []
    with warnings.catch_warnings():
        warnings.simplefilter(warned)
        warnings.simplefilter("ignore", MrworkWarning)
        for valid in room(tmp_path):
            for argument, value in valid.arguments.items():
                for label, other in others(value):
                    if found := said(valid, **{argument: other}):
                        broken.append(f"{valid.name}: `{argument}`, {label}: {found}")
    assert not broken, "\n".join(broken)


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.__name__)
def test_the_calls_that_are_made_wrong_are_right(room: Callable[[Path], Calls], tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for valid in room(tmp_path):
            if valid.name not in REFUSED:
                valid.function(**valid.arguments)
