"""Faults of records of ground motions, in formats of networks and as CSV, for `tools.faults.planted`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.motions import GroundMotion, read_motion, suite
from mrwork.motions.ground_motion import copies_among
from mrwork.motions.synthetic import Soil
from tools.faults.planted import Rng, Said, said_by

Floats = NDArray[np.float64]
SOILS: Final[tuple[Soil, ...]] = ("rock", "firm", "medium", "soft")


def motion_of(rng: Rng) -> GroundMotion:
    """A motion of any soil, with a peak of 0.3 to 8 m/s2, at rest for a while before or after."""
    soil, dt = SOILS[rng.integers(len(SOILS))], float(rng.choice([0.005, 0.01, 0.02]))
    (motion,) = suite(soil, 1, rng=int(rng.integers(1 << 30)), dt=dt)
    size = float(np.exp(rng.uniform(np.log(0.3), np.log(8.0)))) / motion.peak
    rest = [int(rng.integers(0, 3.0 / dt)) for _ in range(2)]
    return replace(motion, acceleration=np.pad(size * motion.acceleration, rest))


# Head and sample of a file of each format, samples in a line, and the column that is asked for.
FORMS: Final = (
    ("t_s,acceleration_mps2", "{t:.6f},{a:.6f}", 1, None),
    ("CORRECTED ACCELEROGRAM   CHAN  1:  90 DEG\nUNCORRECTED ACCELEROGRAM DATA\nEVENT\n{n} POINTS OF ACCEL DATA "
     "EQUALLY SPACED AT {dt:.6f} SEC.  (UNITS: CM/SEC/SEC)", "{gal:12.4f}", 8, None),
    ("STRONG GROUND MOTION RECORDS\nSAMPLING INTERVAL (sec) : {dt:g}\nRAW PGA VALUES (gal)    :\n N-S  E-W",
     "{gal:14.6f} 0.0", 1, "N-S"),
)  # fmt: skip
Form = tuple[str, str, int, str | None]


def _said(motion: GroundMotion, form: Form, folder: Path) -> str:
    """What is said of a motion that is read back from a file of a format."""
    (head, sample, n_line, column), path = form, folder / "motion.txt"
    pairs = zip(motion.time, motion.acceleration, strict=True)
    cells = [sample.format(t=t, a=a, gal=100.0 * a) for t, a in pairs]
    lines = ("".join(cells[first : first + n_line]) for first in range(0, len(cells), n_line))
    path.write_text("\n".join([head.format(n=motion.n_time, dt=motion.dt), *lines, ""]))
    return said_by(partial(read_motion, path, column=column))


def honest(rng: Rng, folder: Path) -> str:
    """A motion in any format, one of four that are no copies."""
    motions = [replace(motion_of(rng), name=f"record {number}") for number in range(4)]
    return _said(motions[0], FORMS[rng.integers(len(FORMS))], folder) or str(copies_among(motions) or "")


def _copied(rng: Rng, _: Path) -> str:
    """A copy with another factor and padding among six records."""
    motions = [replace(motion_of(rng), name=f"record {number}") for number in range(6)]
    acceleration = rng.uniform(0.3, 3.0) * np.pad(motions[0].acceleration, (int(rng.integers(500)), 0))
    return str(copies_among([*motions, replace(motions[0], name="another", acceleration=acceleration)]) or "")


def _planted(
    samples: Callable[[Floats, Rng], Floats], step: Callable[[float, Rng], float] = lambda dt, _: dt
) -> tuple[Said, ...]:
    """A change of the samples or their step, in a file of each format."""

    def fault(form: Form, rng: Rng, folder: Path) -> str:
        whole = motion_of(rng)
        acceleration, dt = samples(whole.acceleration, rng), step(whole.dt, rng)
        return _said(replace(whole, acceleration=acceleration, dt=dt), form, folder)

    return tuple(partial(fault, form) for form in FORMS)


def _peak(acceleration: Floats) -> float:
    return float(np.abs(acceleration).max())


# Numbers in gal or mm/s2 taken for m/s2, numbers in g taken for gal or mm/s2.
_UNITS: Final = (100.0, 1000.0, 0.01 / 98.0665, 0.001 / 9.80665)
FAULTS: Final = {
    "spike": _planted(
        lambda a, rng: (
            a + rng.uniform(3.0, 10.0) * _peak(a) * (np.arange(a.size) == rng.integers(1, a.size - 1))
        )
    ),
    "clipping": _planted(lambda a, rng: np.clip(a, -(top := rng.uniform(0.4, 0.75) * _peak(a)), top)),
    # At least three metres of drift, at any step.
    "offset": _planted(
        lambda a, rng: a + max(rng.uniform(0.01, 0.1) * _peak(a), 6.0 / (0.005 * a.size) ** 2)
    ),
    "step": _planted(lambda a, _: a, lambda dt, rng: float(rng.choice([1.0, 1e3 * dt, 1e-3 * dt]))),
    "no motion": _planted(lambda a, rng: np.full(a.size, rng.choice([0.0, 0.5]))),
    "unit": _planted(lambda a, rng: a * max(1.0, 0.5 / _peak(a)) * rng.choice(_UNITS)),
    "copies": (_copied,),
}
