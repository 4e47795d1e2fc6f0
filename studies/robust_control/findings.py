"""Findings of a level: laws on motions that were not tuned on, and what a clairvoyant reaches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.closed_loop import SCORE, ClairvoyantSettings, clairvoyant
from studies.former.pieces import results_of
from studies.former.scores import PEAKS

CLAIRVOYANT = "clairvoyant"
Loop = tuple[mr.Building, tuple[mr.Device, ...], mr.Hardware]
# Iterations that leave some percent to be found, in minutes instead of hours.
_SEARCH = ClairvoyantSettings(interval=0.02, explore=15, finish=45)


def level_found(
    study: mr.Study,
    results: mr.tuning.TuningResults,
    *,
    clairvoyants: int,
    threads: int,
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Rows of the laws and references of a tuning, and of the clairvoyant under the first test motions."""
    found: dict[str, Any] = {
        "candidates_per_second": results.candidates_per_second,
        "share_outside": results.seconds_outside / results.seconds,
        "laws": {each.label: _row(each) for each in (*results.references, *results.laws)},
    }
    if clairvoyants:
        found[CLAIRVOYANT] = _clairvoyants(study, clairvoyants, threads, say)
    return found


def _row(law: mr.tuning.LawResult) -> dict[str, Any]:
    assert law.test is not None
    spread = law.test.spread["score"]
    return {
        "training": law.train.score,
        "test": law.test.score,
        "lower_quartile": spread.lower_quartile,
        "upper_quartile": spread.upper_quartile,
        "ratios": {name: law.test.criteria[name] for name in SCORE},
        "rms_current": law.test.largest["rms_current"],
        "peak_stroke": law.test.largest["peak_stroke"],
        "bands": {name: asdict(law.test.bands[name]) for name in ("score", "peak_drift") if law.test.bands},
        "motions": {each.motion: each.score for each in law.test.motions},
        "peaks": {each.motion: [each.criteria[name] for name in PEAKS] for each in law.test.motions},
        "settings": law.settings,
        "origin": law.origin,
    }


def _clairvoyants(study: mr.Study, count: int, threads: int, say: Callable[[str], None]) -> dict[str, Any]:
    motions = [each.ground for each in study.motions if each.use == "test"][:count]
    found = results_of(tuple, clairvoyant_under, loop_of(study), [(motion, threads) for motion in motions])
    scores, ratios = {}, []
    for motion in motions:
        say(f"{study.title}: clairvoyant under {motion.name}")
        scores[motion.name], under = next(found)
        ratios.append(under)
    return {"motions": scores, "ratios": dict(zip(SCORE, np.mean(ratios, axis=0).tolist(), strict=True))}


def loop_of(study: mr.Study) -> Loop:
    """Building, devices and hardware of a study."""
    return study.building, tuple(study.devices), study.hardware


def clairvoyant_under(loop: Loop, motion: mr.GroundMotion, threads: int) -> tuple[float, list[float]]:
    """Score and criteria of the best command history under a motion, a local optimum of several starts."""
    building, devices, hardware = loop
    best = clairvoyant(building, devices, motion, hardware, settings=_SEARCH, threads=threads)
    return best.score, [best.ratios[name] for name in SCORE]
