"""Gradients through the closed loop: how well they agree with differences, and what both cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import mrwork as mr
from mrwork.report import Table
from studies.former.arrays import Floats
from studies.former.table import Cell, table_of
from studies.former.timing import time_in_turns

CASES = ("one damper", "two dampers, observer, delay", "storeys that yield")
# The weights of the regulator inside a learned law, and the scales of its signals.
_SETTINGS = (
    "accelerations",
    "drifts",
    "displacements",
    "velocities",
    "relative_velocities",
    "rates",
    "control_weight",
    "deformation",
    "rate",
    "force",
)
_DAMPER = {"storey": 1, "preset": "kwok2006", "lag": 190.0, "differential": True}
# Steps of the differences, in the range of a setting; the best one counts.
_STEPS = (1e-6, 1e-5, 1e-4)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopRow:
    """A score in so many settings under so many motions: seconds of a value and of both gradients, medians.

    `differences` are central ones, all candidates in one call. `apart` is the largest difference from these for the
    best step, over the largest derivative, and `apart_usual` for the longest.
    """

    case: str
    settings: int
    motions: int
    value: float
    gradient: float
    differences: float
    apart: float
    apart_usual: float


def measure(
    *, threads: int, cases: Sequence[str], motions: int, duration: float, rounds: int
) -> Iterator[LoopRow | str]:
    """Rows of every case, the contenders in turns."""
    for case in cases:
        yield case
        yield _row(case, _study(case, motions, duration), threads, rounds)


def _study(case: str, motions: int, duration: float) -> mr.Study:
    building: dict[str, Any] = {"published": "uts"}
    more: dict[str, Any] = {}
    dampers = [_DAMPER]
    if case == "storeys that yield":
        building["storeys_that_yield"] = {"yield_drift": "2 mm", "sharpness": 2.0}
    if case == "two dampers, observer, delay":
        dampers.append({**_DAMPER, "storey": 3})
        more["hardware"] = mr.Hardware(feedback="observer", acceleration_noise=0.01, delay=4e-3)
    return mr.study_of(
        building=building,
        dampers=dampers,
        motions=[
            {
                "synthetic": "kanai_tajimi",
                "duration": duration,
                "pga": "0.1 g",
                "seed": seed,
                "name": str(seed),
            }
            for seed in range(motions)
        ],
        **more,
    )


def _row(case: str, study: mr.Study, threads: int, rounds: int) -> LoopRow:
    first = mr.jax.study_score(study, "signal_network", threads=threads)
    learned = [
        value for name, value in zip(first.names, first.start, strict=True) if name.startswith("network")
    ]
    table = mr.study.TuneTable(
        laws=("signal_network",), settings={"network": learned}, free=dict.fromkeys(_SETTINGS, ())
    )
    score = mr.jax.study_score(study, table, coordinates="unit", threads=threads)
    start = 0.35 + 0.04 * (np.arange(len(score.start)) % 7)
    point = jnp.array(start)
    gradient, values = jax.jit(jax.value_and_grad(score)), jax.jit(jax.vmap(score))

    def differences(step: float) -> Floats:
        moves = step * np.eye(len(start))
        found = np.asarray(values(jnp.array(np.concatenate([start + moves, start - moves]))))
        return (found[: len(start)] - found[len(start) :]) / (2.0 * step)

    exact = np.asarray(gradient(point)[1])
    apart = [float(np.abs(exact - differences(step)).max() / np.abs(exact).max()) for step in _STEPS]
    seconds, _ = time_in_turns(
        {
            "value": lambda: np.asarray(values(point[None])),
            "gradient": lambda: np.asarray(gradient(point)[1]),
            "differences": lambda: differences(_STEPS[0]),
        },
        rounds,
        lambda: 0.0,
    )
    return LoopRow(
        case=case,
        settings=len(start),
        motions=len(study.motions),
        apart=min(apart),
        apart_usual=apart[-1],
        **seconds,
    )


def tables(rows: Sequence[LoopRow]) -> Iterator[Table]:
    """Seconds and agreement of every case."""
    columns: dict[str, Cell] = {
        "value s": "{value:.3f}",
        "gradient s": "{gradient:.3f}",
        "central differences s": "{differences:.3f}",
        "differences over gradient": lambda row: f"{row['differences'] / row['gradient']:.2f}",
        "apart, best step": "{apart:.1e}",
        "apart, step 1e-4": "{apart_usual:.1e}",
    }
    yield table_of(
        "Gradients through the loop",
        "loop",
        ((f"{row.case}, {row.settings} settings, {row.motions} motions", asdict(row)) for row in rows),
        columns,
    )


def judged(rows: Sequence[LoopRow]) -> dict[str, float]:
    """The largest difference from the best central differences."""
    return {"apart": max(row.apart for row in rows)}
