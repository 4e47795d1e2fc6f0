"""Score of a control law: one frame with a pair of dampers under motions that its designer did not have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import mrwork as mr
from mrwork.closed_loop import SCORE, STANDARD_GRAVITY, UserLaw
from mrwork.errors import SettingError
from mrwork.motions import suite
from studies.former.arrays import Floats
from studies.former.frame import FRAME, HARDWARE, RECORDS, pair, scaled_records
from studies.former.scores import PEAKS, constant_commands, criteria
from studies.leaderboard.best_constant import best_constant
from studies.leaderboard.damper_scores import SEED
from studies.leaderboard.entries import Entry, Motions
from studies.leaderboard.measured import MOTIONS, measured_files

PEAK = 0.1 * STANDARD_GRAVITY
"""Peak ground acceleration of all motions [m/s^2], at which the best constant command is not the largest one."""
N_TRAINING, N_SYNTHETIC = 12, 18
# The motions of one seed do not return in the suite of the other.
_TRAINING_SEED, _TEST_SEED = 11, 404


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionScore:
    """Ratios under one motion: the peaks to the best constant command, and the criteria of the score to i = 0."""

    to_best_constant: dict[str, float]
    to_passive_off: dict[str, float]

    @property
    def score(self) -> float:
        """Mean of the four ratios to i = 0."""
        return float(np.mean(list(self.to_passive_off.values())))


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """Motions of a table, with the criteria of i = 0 and of the best constant command, shape (n_motions,)."""

    motions: tuple[mr.GroundMotion, ...]
    passive_off: dict[str, Floats]
    best_constant: dict[str, Floats]
    threads: int


def training_motions() -> tuple[mr.GroundMotion, ...]:
    """The motions that every designer is given."""
    return suite(n=N_TRAINING, rng=_TRAINING_SEED, peak=PEAK, name="training")


def synthetic_motions() -> tuple[mr.GroundMotion, ...]:
    """The motions that no designer is given: three soils, half of them with a near-fault pulse."""
    return suite(n=N_SYNTHETIC, rng=_TEST_SEED, peak=PEAK, name="test")


def measured_motions() -> tuple[mr.GroundMotion, ...]:
    """The four records of the benchmarks; none where the files are absent."""
    files = {file.name: file for file in measured_files(MOTIONS)}
    return tuple(scaled_records((files[file] for _, file in RECORDS if files), PEAK / STANDARD_GRAVITY))


def bench(motions: Motions, *, threads: int) -> Bench:
    """The references under these motions; the constant command is the best one on the training motions."""
    off = constant_commands([0.0])
    constant = best_constant(FRAME, pair(), training_motions(), HARDWARE)
    return Bench(
        motions=tuple(motions),
        passive_off=_criteria(off, motions, threads),
        best_constant=_criteria(constant, motions, threads),
        threads=threads,
    )


def score_law(entry: Entry, benches: Sequence[Bench]) -> tuple[dict[str, MotionScore], ...]:
    """Design the law on the training motions, and simulate it under the motions of each bench."""
    law = entry.function(FRAME, pair(), training_motions(), HARDWARE, np.random.default_rng([SEED, 0]))
    if not isinstance(law, mr.ControlLaw | UserLaw):
        raise SettingError(
            f"design returned a {type(law).__name__}; give a ControlLaw or a mr.closed_loop.UserLaw"
        )
    return tuple(_scores(law, over) for over in benches)


def _scores(law: mr.ControlLaw | UserLaw, over: Bench) -> dict[str, MotionScore]:
    found = _criteria(law, over.motions, over.threads)
    return {
        motion.name: MotionScore(
            to_best_constant={name: float(found[name][n] / over.best_constant[name][n]) for name in PEAKS},
            to_passive_off={name: float(found[name][n] / over.passive_off[name][n]) for name in SCORE},
        )
        for n, motion in enumerate(over.motions)
    }


def _criteria(law: mr.ControlLaw | UserLaw, motions: Motions, threads: int) -> dict[str, Floats]:
    """Criteria of the one candidate of a law under each motion, shape (n_motions,)."""
    judged = criteria(FRAME, [pair()], law, motions, HARDWARE, threads=threads)
    if len(judged) != 1:
        raise SettingError(f"the law has {len(judged)} candidates; return the best of them alone")
    for motion, figures in zip(motions, judged[0], strict=True):
        if not np.isfinite(figures).all():
            raise SettingError(f"the run under {motion.name} did not finish; return a law that is stable")
    return dict(zip(SCORE, judged[0].T, strict=True))
