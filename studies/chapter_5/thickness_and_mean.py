"""Thickness and mean of the loops over the velocity: figures 5.6 and 5.7 of the thesis in form.

Both are those of `branches`, of the test and of the model identified at its current, on the same motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.identification import free_run
from mrwork.report import Table, numbers
from studies.chapter_5.loop_branches import Branches, branches
from studies.chapter_5.outcome import WITH_LAWS, PerCurrent, SetOutcome
from studies.former.arrays import Floats

STATIC_MODELS = tuple(model.label for model in WITH_LAWS)
QUANTITIES = ("thickness", "mean")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Three numbers of the loops at each current, shape (n_currents,).

    Thickness at v = 0 [N], its width at half of that [m/s], and the largest mean [N].
    """

    thickness: Floats
    width: Floats
    largest_mean: Floats

    @classmethod
    def of(cls, loops: list[Branches]) -> Sizes:
        return cls(
            thickness=np.array([at_rest(each.thickness.mean(axis=0)) for each in loops]),
            width=np.array([each.width for each in loops]),
            largest_mean=np.array([np.abs(each.mean.mean(axis=0)).max() for each in loops]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopComparison:
    """The loops of the tests of a set over the velocity, and by how much each model misses them.

    `deviation` is the standard deviation of a cycle's thickness at v = 0 [N], shape (n_currents,). `missed` has, by
    model and by "thickness" and "mean", the root mean square over the velocities of model less test, over that of the
    test; `scatter` is what the standard error of the mean over the cycles makes of it. Shapes (n_currents,).
    """

    tests: Sizes
    deviation: Floats
    models: dict[str, Sizes]
    missed: dict[str, dict[str, Floats]]
    scatter: dict[str, Floats]


def compared(outcome: SetOutcome) -> LoopComparison:
    """The loops of every test beside those of the models identified at its current."""
    tests = [branches(test) for test in outcome.tests.tests]
    models = {
        label: [
            branches(test, force=force)
            for test, force in zip(outcome.tests.tests, forces(outcome, each), strict=True)
        ]
        for label, each in outcome.each.items()
    }
    return LoopComparison(
        tests=Sizes.of(tests),
        deviation=np.array([at_rest(each.thickness.std(axis=0, ddof=1)) for each in tests]),
        models={label: Sizes.of(loops) for label, loops in models.items()},
        missed={
            label: {name: _missed(tests, loops, name) for name in QUANTITIES}
            for label, loops in models.items()
        },
        scatter={name: _scatter(tests, name) for name in QUANTITIES},
    )


def forces(outcome: SetOutcome, each: PerCurrent) -> list[Floats]:
    """Force of the model at each current, as recorded."""
    spec = mr.damper(each.model.damper)
    return [
        free_run(spec, np.array(fit.theta), test)[0]
        for fit, test in zip(each.fits, outcome.tests.tests, strict=True)
    ]


def loops_table(outcome: SetOutcome) -> Table:
    """The three numbers at each current, of the test and of the static models, and what these miss."""
    loops = compared(outcome)
    models = {label: sizes for label, sizes in loops.models.items() if label in STATIC_MODELS}
    header = ["i [A]"]
    rows = [[f"{current:g}"] for current in outcome.tests.currents]
    for name, title, factor in (
        ("thickness", "thickness at v = 0 [N]", 1.0),
        ("width", "its width [mm/s]", 1e3),
        ("largest_mean", "largest mean [N]", 1.0),
    ):
        header += [f"{title}: test", *models]
        for place, row in enumerate(rows):
            found = [factor * float(getattr(sizes, name)[place]) for sizes in (loops.tests, *models.values())]
            texts = numbers.column(found, 3)
            if name == "thickness":
                texts[0] += f" ± {numbers.significant(float(loops.deviation[place]), 2)}"
            row += texts
    return Table(
        title=f"Thickness and mean of the loops, {outcome.tests.name}",
        columns=tuple(header),
        rows=tuple(map(tuple, rows)),
        note=" ".join(
            ["Width: full, at half of the thickness at v = 0. ±: of one cycle.", *_sentences(loops)]
        ),
    )


def as_numbers(loops: LoopComparison) -> dict[str, Any]:
    """Everything of a comparison, ready for JSON; means over the currents for expected.toml."""
    found: dict[str, Any] = {
        label: {
            "thickness_n": sizes.thickness.tolist(),
            "width_mm_s": (1e3 * sizes.width).tolist(),
            "largest_mean_n": sizes.largest_mean.tolist(),
        }
        for label, sizes in {"test": loops.tests, **loops.models}.items()
    }
    found["test"]["deviation_n"] = loops.deviation.tolist()
    for label, missed in {"test": loops.scatter, **loops.missed}.items():
        kind = "scatter" if label == "test" else "missed"
        for name, shares in missed.items():
            found[label][f"{name}_{kind}"] = shares.tolist()
            found[label][f"{name}_{kind}_percent"] = 100.0 * float(shares.mean())
    return found


def at_rest(values: Floats) -> float:
    """The value at v = 0, which is in the middle."""
    return float(values[values.size // 2])


def _sentences(loops: LoopComparison) -> list[str]:
    """What the static models miss, in words and percent."""
    said = []
    for label, missed in loops.missed.items():
        if label not in STATIC_MODELS:
            continue
        off = loops.models[label].thickness / loops.tests.thickness - 1.0
        said.append(
            f"The {label} model misses the thickness by {_range(missed['thickness'])} and the mean by "
            f"{_range(missed['mean'])}, the thickness at v = 0 by {_range(off, '+')}."
        )
    return [
        *said,
        "These are root mean squares over the velocities, over that of the test, from the best to the worst current; "
        f"the scatter of the cycles explains {_range(loops.scatter['thickness'])} and "
        f"{_range(loops.scatter['mean'])} of them.",
    ]


def _range(shares: Floats, sign: str = "") -> str:
    low, high = (
        f"{100.0 * float(end):{sign}.2g}".replace("-", numbers.MINUS) for end in (shares.min(), shares.max())
    )
    return f"{low} to {high} %"


def _missed(tests: list[Branches], models: list[Branches], name: str) -> Floats:
    pairs = [
        (getattr(model, name).mean(axis=0), getattr(test, name).mean(axis=0))
        for model, test in zip(models, tests, strict=True)
    ]
    return np.array([_rms(model - test) / _rms(test) for model, test in pairs])


def _scatter(tests: list[Branches], name: str) -> Floats:
    cycles = [getattr(test, name) for test in tests]
    return np.array(
        [_rms(each.std(axis=0, ddof=1)) / np.sqrt(len(each)) / _rms(each.mean(axis=0)) for each in cycles]
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
