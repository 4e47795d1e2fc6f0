"""Records with one planted fault each, beside as many honest ones: `python -m tools.faults.planted_motions [COUNT]`.

Synthetic motions are written in formats of networks and as CSV, and read back; nothing is simulated. Printed is the
share of each kind that is told, by a refusal or a warning, and that of the honest records of which something is said.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import MrworkError, MrworkWarning
from mrwork.motions import GroundMotion, read_motion, suite
from mrwork.motions.ground_motion import copies_among
from mrwork.motions.synthetic import Soil

Floats = NDArray[np.float64]
Rng = np.random.Generator
SOILS: tuple[Soil, ...] = ("rock", "firm", "medium", "soft")


def honest(rng: Rng) -> GroundMotion:
    """A motion of any soil, with a peak of 0.3 to 8 m/s2, at rest for a while before or after."""
    soil = SOILS[rng.integers(len(SOILS))]
    dt = float(rng.choice([0.005, 0.01, 0.02]))
    (motion,) = suite(soil, 1, rng=int(rng.integers(1 << 30)), dt=dt)
    size = float(np.exp(rng.uniform(np.log(0.3), np.log(8.0)))) / motion.peak
    rest = [np.zeros(int(rng.integers(0, 3.0 / dt))) for _ in range(2)]
    acceleration = np.concatenate([rest[0], size * motion.acceleration, rest[1]])
    return replace(motion, acceleration=acceleration)


def _csv(motion: GroundMotion) -> list[str]:
    pairs = zip(motion.time, motion.acceleration, strict=True)
    return ["t_s,acceleration_mps2", *(f"{time:.6f},{value:.6f}" for time, value in pairs)]


def _csmip(motion: GroundMotion) -> list[str]:
    series = (
        f"{motion.n_time} POINTS OF ACCEL DATA EQUALLY SPACED AT {motion.dt:.6f} SEC.  (UNITS: CM/SEC/SEC)"
    )
    head = ["CORRECTED ACCELEROGRAM   CHAN  1:  90 DEG", "UNCORRECTED ACCELEROGRAM DATA", "EVENT", series]
    cells = [f"{value:12.4f}" for value in 100.0 * motion.acceleration]
    return [*head, *("".join(cells[start : start + 8]) for start in range(0, len(cells), 8))]


def _afad(motion: GroundMotion) -> list[str]:
    head = [
        "STRONG GROUND MOTION RECORDS",
        f"SAMPLING INTERVAL (sec) : {motion.dt:g}",
        "RAW PGA VALUES (gal)    :",
    ]
    rows = [f"{value:14.6f}{0.0:14.6f}" for value in 100.0 * motion.acceleration]
    return [*head, "       N-S          E-W", *rows]


# The writer of each format, and the column that is asked for.
WRITERS: Mapping[str, tuple[Callable[[GroundMotion], list[str]], str | None]] = {
    "CSV": (_csv, None), "CSMIP": (_csmip, None), "AFAD": (_afad, "N-S"),
}  # fmt: skip


def _spiky(a: Floats, dt: float, rng: Rng) -> tuple[Floats, float]:
    place, height = int(rng.integers(1, a.size - 1)), rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 10.0)
    return np.where(np.arange(a.size) == place, height * np.abs(a).max(), a), dt


def _clipped(a: Floats, dt: float, rng: Rng) -> tuple[Floats, float]:
    top = rng.uniform(0.4, 0.75) * np.abs(a).max()
    return np.clip(a, -top, top), dt


def _offset(a: Floats, dt: float, rng: Rng) -> tuple[Floats, float]:
    # At least three metres of drift.
    least = 6.0 / (dt * a.size) ** 2
    return a + rng.choice([-1.0, 1.0]) * max(rng.uniform(0.01, 0.1) * np.abs(a).max(), least), dt


def _in_another_unit(a: Floats, dt: float, rng: Rng) -> tuple[Floats, float]:
    # Numbers in gal or mm/s2 taken for m/s2, numbers in g taken for gal or mm/s2.
    strong = a * max(1.0, 0.5 / np.abs(a).max())
    return strong * rng.choice([100.0, 1000.0, 0.01 / 98.0665, 0.001 / 9.80665]), dt


FAULTS: Mapping[str, Callable[[Floats, float, Rng], tuple[Floats, float]]] = {
    "spike": _spiky,
    "clipping": _clipped,
    "offset": _offset,
    "step": lambda a, dt, rng: (a, float(rng.choice([1.0, 1e3 * dt, 1e-3 * dt]))),
    "no motion": lambda a, dt, rng: (np.full(a.size, rng.choice([0.0, 0.5])), dt),
    "unit": _in_another_unit,
}


def is_told(motion: GroundMotion, form: str, path: Path) -> bool:
    """Whether reading the motion back from a file of a format is refused or warned of."""
    write, column = WRITERS[form]
    path.write_text("\n".join(write(motion)) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error", MrworkWarning)
        try:
            read_motion(path, column=column)
        except (MrworkError, MrworkWarning):
            return True
    return False


def has_copies(rng: Rng, *, planted: bool) -> bool:
    """Whether a copy is told among records, of which one has, or has not, another factor and padding."""
    motions = [replace(honest(rng), name=f"record {number}") for number in range(6)]
    first, rest = motions[0], np.zeros(int(rng.integers(500)))
    padded = np.concatenate([rest, rng.uniform(0.3, 3.0) * first.acceleration])
    return bool(
        copies_among([*motions, *([replace(first, name="another", acceleration=padded)] if planted else [])])
    )


def sweep(count: int, folder: Path) -> tuple[dict[str, float], float]:
    """The share of so many faulty records that is told, by kind, and the share of honest ones with a false alarm."""
    rng, kinds, forms = np.random.default_rng(71), (*FAULTS, "copies"), tuple(WRITERS)
    told: dict[str, list[bool]] = {kind: [] for kind in kinds}
    alarms: list[bool] = []
    for number in range(count):
        kind, form = kinds[number % len(kinds)], forms[number // len(kinds) % len(forms)]
        whole = honest(rng)
        if kind not in FAULTS:
            told[kind].append(has_copies(rng, planted=True))
            alarms.append(has_copies(rng, planted=False))
            continue
        acceleration, dt = FAULTS[kind](whole.acceleration, whole.dt, rng)
        faulty = replace(whole, acceleration=acceleration, dt=dt)
        told[kind].append(is_told(faulty, form, folder / "motion.txt"))
        alarms.append(is_told(honest(rng), form, folder / "motion.txt"))
    return {kind: float(np.mean(each)) for kind, each in told.items() if each}, float(np.mean(alarms))


def main(arguments: Sequence[str]) -> int:
    """Print the shares."""
    with tempfile.TemporaryDirectory() as folder:
        told, alarms = sweep(int(arguments[0]) if arguments else 500, Path(folder))
    for kind, share in told.items():
        print(f"{kind:10} told {100.0 * share:5.1f} %")
    print(f"honest records with a false alarm {100.0 * alarms:.1f} %")
    return int(min(told.values()) < 0.9 or alarms > 0.01)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
