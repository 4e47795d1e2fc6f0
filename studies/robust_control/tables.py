"""Findings as tables, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.closed_loop import SCORE
from mrwork.report import Table
from mrwork.study import OPTIMAL_PASSIVE, PASSIVE_OFF, PASSIVE_ON
from studies.common.scores import TITLES
from studies.robust_control.findings import CLAIRVOYANT

# A fifth of the test motions, as the risk of the robust law takes.
_WORST = 4
# A law that is nearly the constant command may be better by nothing that matters.
_CLEARLY = 0.01
ANY = "best of them, by motion"
Floats = NDArray[np.float64]
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
    def cells(row: Mapping[str, Any]) -> tuple[str, ...]:
        names = list(row["motions"])
        groups = (
            [each for each in names if is_record(each)],
            [each for each in names if not is_record(each)],
        )
        return (
            f"{row['training']:.3f}",
            *(f"{mean_over(row['motions'], group):.3f}" if group else "" for group in groups),
            f"{row['lower_quartile']:.2f} to {row['upper_quartile']:.2f}",
            f"{np.mean(sorted(row['motions'].values())[-_WORST:]):.3f}",
            *(f"{row['ratios'][name]:.3f}" for name in SCORE),
            f"{row['rms_current']:.2f}",
            f"{1e3 * row['peak_stroke']:.1f}",
        )

    return Table(
        title=f"Scores at {level}",
        columns=(
            "law",
            "training",
            "four",
            "sixteen",
            "middle half",
            "worst four",
            *TITLES.values(),
            "current [A]",
            "stroke [mm]",
        ),
        rows=tuple((label, *cells(row)) for label, row in laws.items()),
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

    def cells(ratios: Floats) -> Iterator[str]:
        for lower in (*(ratios < 1.0).T, (ratios < 1.0).all(axis=1), (ratios < 1.0 - _CLEARLY).all(axis=1)):
            yield f"{int(lower.sum())} of {len(ratios)}"
        yield f"{ratios.max(axis=1).mean():.3f}"

    return Table(
        title=f"Peaks below those of the best constant command at {level}",
        columns=(
            "law",
            "peak drift",
            "peak acc.",
            "both",
            f"both by {_CLEARLY:.0%}",
            "mean of the larger ratio",
        ),
        rows=tuple((label, *cells(ratios)) for label, ratios in over.items()),
        note=f"Test motions. {ANY}: for each motion the law with the smallest larger ratio, chosen after the fact.",
    )


def _peaks(row: Mapping[str, Any]) -> Floats:
    """Ratios of the two peaks to i = 0 under each motion, shape (n_motions, 2)."""
    return np.array(list(row["peaks"].values()))


def _bands(level: str, laws: Mapping[str, Any]) -> Table:
    def cells(row: Mapping[str, Any]) -> Iterator[str]:
        for name in ("score", "peak_drift"):
            band = row["bands"][name]
            yield f"{band['median']:.3f}"
            yield f"{band['lower']:.3f} to {band['upper']:.3f}"

    return Table(
        title=f"Over draws of the damper, stiffness, damping and delay at {level}",
        columns=("law", "score", "90 % band", "peak drift", "90 % band"),
        rows=tuple((label, *cells(row)) for label, row in laws.items() if row["bands"]),
        note="Each is the mean over the test motions of a ratio to i = 0 of the same realisation.",
    )


def _left(level: str, laws: Mapping[str, Any], best: Mapping[str, Any]) -> Table:
    names = list(best["motions"])
    rows = [
        (label, *(f"{row['motions'][name]:.3f}" for name in names), f"{mean_over(row['motions'], names):.3f}")
        for label, row in laws.items()
    ]
    rows.append(
        (
            CLAIRVOYANT,
            *(f"{each:.3f}" for each in best["motions"].values()),
            f"{mean_over(best['motions'], names):.3f}",
        )
    )
    return Table(
        title=f"How much is left at {level}",
        columns=("law", *names, "mean"),
        rows=tuple(rows),
        note="The clairvoyant knows the motion; it is a local optimum of several starts, not certified.",
    )
