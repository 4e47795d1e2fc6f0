"""Findings as tables, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from mrwork.report import Table
from mrwork.study import OPTIMAL_PASSIVE, PASSIVE_OFF, PASSIVE_ON
from studies.former.arrays import Floats
from studies.former.scores import TITLES
from studies.former.table import table_of
from studies.robust_control.findings import CLAIRVOYANT

# A fifth of the test motions, as the risk of the robust law takes.
_WORST = 4
# A law that is nearly the constant command may be better by nothing that matters.
_CLEARLY = 0.01
ANY = "best of them, by motion"
# Records of the benchmarks, by the names of their files; the other test motions are the sixteen measured ones.
RECORDS = ("el_centro", "hachinohe", "kobe", "northridge")


def tables(found: Mapping[str, Any]) -> Iterator[Table]:
    """The tables of the README."""
    for level, figures in found.items():
        laws = figures["laws"]
        yield _scores(level, laws)
        yield _both_peaks(level, laws)
        if any(row["bands"] for row in laws.values()):
            yield _bands(level, laws)
        if CLAIRVOYANT in figures:
            yield _left(level, laws, figures[CLAIRVOYANT])


def mean_over(scores: Mapping[str, float], names: Sequence[str]) -> float:
    """Mean score over the motions of these names."""
    return float(np.mean([scores[name] for name in names]))


def is_record(name: str) -> bool:
    """Whether a motion is one of the four records."""
    return name.startswith(RECORDS)


def _scores(level: str, laws: Mapping[str, Any]) -> Table:
    def group(row: Mapping[str, Any], *, records: bool) -> str:
        names = [name for name in row["motions"] if is_record(name) is records]
        return f"{mean_over(row['motions'], names):.3f}" if names else ""

    return table_of(
        f"Scores at {level}",
        "law",
        laws,
        {
            "training": "{training:.3f}",
            "four": partial(group, records=True),
            "sixteen": partial(group, records=False),
            "middle half": "{lower_quartile:.2f} to {upper_quartile:.2f}",
            "worst four": lambda row: f"{np.mean(sorted(row['motions'].values())[-_WORST:]):.3f}",
            **{title: f"{{ratios[{name}]:.3f}}" for name, title in TITLES.items()},
            "current [A]": "{rms_current:.2f}",
            "stroke [mm]": lambda row: f"{1e3 * row['peak_stroke']:.1f}",
        },
        note="Score on the training motions, the four records and the sixteen measured motions; range of the middle "
        "half of these twenty, mean of the worst four; means of their ratios to i = 0; largest rms current and stroke.",
    )


def _both_peaks(level: str, laws: Mapping[str, Any]) -> Table:
    """Under how many motions each law has lower peaks than the best constant command, and any of the laws."""
    constant = _peaks(laws[OPTIMAL_PASSIVE])
    over = {
        label: _peaks(row) / constant
        for label, row in laws.items()
        if label not in (OPTIMAL_PASSIVE, PASSIVE_OFF, PASSIVE_ON)
    }
    over[ANY] = np.stack(list(over.values()))[
        np.argmin([each.max(axis=1) for each in over.values()], axis=0), np.arange(len(constant))
    ]

    def lower(ratios: Floats, by: float, columns: slice) -> str:
        return f"{int((ratios < 1.0 - by)[:, columns].all(axis=1).sum())} of {len(ratios)}"

    return table_of(
        f"Peaks below those of the best constant command at {level}",
        "law",
        over,
        {
            "peak drift": partial(lower, by=0.0, columns=slice(0, 1)),
            "peak acc.": partial(lower, by=0.0, columns=slice(1, 2)),
            "both": partial(lower, by=0.0, columns=slice(0, 2)),
            f"both by {_CLEARLY:.0%}": partial(lower, by=_CLEARLY, columns=slice(0, 2)),
            "mean of the larger ratio": lambda ratios: f"{ratios.max(axis=1).mean():.3f}",
        },
        note=f"Test motions. {ANY}: for each motion the law with the smallest larger ratio, chosen after the fact.",
    )


def _peaks(row: Mapping[str, Any]) -> Floats:
    """Ratios of the two peaks to i = 0 under each motion, shape (n_motions, 2)."""
    return np.array(list(row["peaks"].values()))


def _bands(level: str, laws: Mapping[str, Any]) -> Table:
    columns: dict[str, str] = {}
    for name, title in (("score", "score"), ("peak_drift", "peak drift")):
        columns[title] = f"{{bands[{name}][median]:.3f}}"
        columns[f"{title}, 90 % band"] = f"{{bands[{name}][lower]:.3f}} to {{bands[{name}][upper]:.3f}}"
    return table_of(
        f"Over draws of the damper, stiffness, damping and delay at {level}",
        "law",
        {label: row for label, row in laws.items() if row["bands"]},
        columns,
        note="Each is the mean over the test motions of a ratio to i = 0 of the same realisation.",
    )


def _left(level: str, laws: Mapping[str, Any], best: Mapping[str, Any]) -> Table:
    names = list(best["motions"])
    return table_of(
        f"How much is left at {level}",
        "law",
        {label: row["motions"] for label, row in (*laws.items(), (CLAIRVOYANT, best))},
        {
            **{name: lambda scores, name=name: f"{scores[name]:.3f}" for name in names},
            "mean": lambda scores: f"{mean_over(scores, names):.3f}",
        },
        note="The clairvoyant knows the motion; it is a local optimum of several starts, not certified.",
    )
