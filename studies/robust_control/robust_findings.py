"""Every finding of the study: laws of each level on motions that were not tuned on, and what a clairvoyant reaches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.closed_loop import SCORE, ClairvoyantSettings, clairvoyant

HERE = Path(__file__).parent
LEVELS = {"0.1 g": HERE / "level_01.toml", "0.3 g": HERE / "level_03.toml"}
CLAIRVOYANT = "clairvoyant"
# Iterations that leave some percent to be found, in minutes instead of hours.
_SEARCH = ClairvoyantSettings(interval=0.02, explore=15, finish=45)


def found_by(
    levels: Sequence[str], *, clairvoyants: int, threads: int, quick: bool, say: Callable[[str], None]
) -> dict[str, Any]:
    """Figures of each level, as nested dictionaries."""
    return {
        level: level_found(
            mr.read_study(LEVELS[level]), clairvoyants=clairvoyants, threads=threads, quick=quick, say=say
        )
        for level in levels
    }


def level_found(
    study: mr.Study, *, clairvoyants: int, threads: int, quick: bool, say: Callable[[str], None]
) -> dict[str, Any]:
    """Rows of the laws and references of one study, and of the clairvoyant under the first test motions."""
    last = ""

    def progress(now: mr.tuning.TuningProgress) -> None:
        nonlocal last
        if now.label != last:
            last = now.label
            say(f"{study.title}: {last}")

    # The quick form tunes two laws as they are by default, with a few candidates.
    quickly: dict[str, Any] = (
        {"laws": ["clipped_optimal", "proportional_direct"], "budget": 24} if quick else {}
    )
    results = mr.tune(study, threads=threads, on_progress=progress, **quickly)
    found: dict[str, Any] = {
        "candidates_per_second": results.candidates_per_second,
        "share_outside": results.share_outside,
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
        "better": None if law.better is None else asdict(law.better),
        "bands": {name: asdict(law.test.bands[name]) for name in ("score", "peak_drift") if law.test.bands},
        "motions": {each.motion: each.score for each in law.test.motions},
        "settings": law.settings,
        "origin": law.origin,
    }


def _clairvoyants(study: mr.Study, count: int, threads: int, say: Callable[[str], None]) -> dict[str, Any]:
    motions = [each.ground for each in study.motions if each.use == "test"][:count]
    scores, ratios = {}, []
    for motion in motions:
        say(f"{study.title}: clairvoyant under {motion.name}")
        found = clairvoyant(
            study.building, study.devices, motion, study.hardware, settings=_SEARCH, threads=threads
        )
        scores[motion.name] = found.score
        ratios.append([found.ratios[name] for name in SCORE])
    return {"motions": scores, "ratios": dict(zip(SCORE, np.mean(ratios, axis=0).tolist(), strict=True))}
