"""Rigs with one planted fault each, and as many honest ones: `python -m tools.faults.planted_rigs [RIGS]`.

Printed are, by kind, the share of the faults that the checks tell, and the honest rigs that get a warning or a refusal.
Nothing is fitted. A new kind of fault is a function with its words in `FAULTS`.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.random import Generator

from mrwork.errors import MrworkError
from mrwork.records import read_damper_test
from mrwork.records.findings import findings_of_set

# Names of time, displacement, force and velocity, with the units behind them and the encoding of the file.
_HEADERS = (
    ("t_{}", "displacement_{}", "force_{}", "velocity_{}", "utf-8"),
    ("Time ({})", "Stroke ({})", "Axial Force ({})", "Velocity ({})", "utf-8"),
    ("Zeit [{}]", "Kolbenweg [{}]", "Dämpferkraft [{}]", "Kolbengeschwindigkeit [{}]", "cp1252"),
    ("時間({})", "変位({})", "荷重({})", "速度({})", "cp932"),
    ("时间({})", "活塞位移({})", "阻尼力({})", "速度({})", "gb18030"),
    ("Temps ({})", "Déplacement ({})", "Force ({})", "Vitesse ({})", "utf-16"),
)
_TO_SI = {"s": 1.0, "ms": 1e-3, "m": 1.0, "mm": 1e-3, "N": 1.0, "kN": 1e3, "m/s": 1.0, "mm/s": 1e-3}
_COMMANDS = (0.0, 0.5, 1.0)


@dataclass(frozen=True, kw_only=True)
class Rig:
    """A rig as its files state it: columns, the units in which they are written, and those that the names say."""

    tests: dict[str, list[np.ndarray]]
    names: tuple[str, ...]
    encoding: str
    written: list[str]
    said: list[str]
    current: dict[str, float] = field(default_factory=dict)
    edit: Callable[[list[str]], list[str]] = list

    def write(self, folder: Path) -> list[Path]:
        """Write its files."""
        paths = []
        for stem, columns in self.tests.items():
            head = [name.format(unit) for name, unit in zip(self.names, self.said, strict=True)]
            rows = np.stack([each / _TO_SI[unit] for each, unit in zip(columns, self.written, strict=True)])
            if stem in self.current:
                head.append("current_A")
                rows = np.vstack([rows, np.full(rows.shape[1], self.current[stem])])
            lines = self.edit([";".join(head), *(";".join(f"{x:.9g}" for x in row) for row in rows.T)])
            paths.append(folder / f"{stem}.csv")
            paths[-1].write_bytes(("\r\n".join(lines) + "\r\n").encode(self.encoding))
        return paths


Plant = Callable[[Rig, Generator], Rig]


def honest(rng: Generator) -> Rig:
    """Three motions at three commands of a damper of 0.5 to 5 kN, with or without its velocity."""
    *names, encoding = _HEADERS[rng.integers(len(_HEADERS))]
    size, friction = 10.0 ** rng.uniform(2.7, 3.7), rng.uniform(0.02, 0.1)
    amplitude, has_velocity = rng.uniform(6e-3, 4e-2), rng.random() < 0.5
    tests: dict[str, list[np.ndarray]] = {}
    for frequency in (0.5, 1.0, 2.0):
        for command in _COMMANDS:
            time = np.arange(0.0, 4.0 / frequency, 1.0 / (200.0 * frequency))
            phase = 2.0 * np.pi * frequency * time
            x, v = amplitude * np.sin(phase), 2.0 * np.pi * frequency * amplitude * np.cos(phase)
            level = size * (friction + command)
            force = level * np.tanh((v + 0.05 * x * frequency) / (0.05 * amplitude)) + 0.2 * size * v
            force += 2e-3 * np.ptp(force) * rng.standard_normal(time.size)
            x = x + 2e-4 * amplitude * rng.standard_normal(time.size)
            tests[f"{1e3 * amplitude:.0f}mm_{frequency:g}Hz_{1e3 * command:.0f}mA"] = [time, x, force, v]
    kept = 4 if has_velocity else 3
    units = [str(rng.choice(each)) for each in (("s", "ms"), ("mm", "m"), ("N", "kN"), ("m/s", "mm/s"))][
        :kept
    ]
    tests = {stem: columns[:kept] for stem, columns in tests.items()}
    return Rig(tests=tests, names=tuple(names[:kept]), encoding=encoding, written=units, said=list(units))


def _units(place: int, written: str, said: str) -> Plant:
    def plant(rig: Rig, _: Generator) -> Rig:
        changed = (
            [*own[:place], unit, *own[place + 1 :]]
            for own, unit in ((rig.written, written), (rig.said, said))
        )
        return replace(rig, **dict(zip(("written", "said"), changed, strict=True)))

    return plant


def _markers(rig: Rig, rng: Generator) -> Rig:
    marks = rng.choice(["EVENT 3", "Start;;", "1205;Switched from 1 to 2;", "% step 2", "Marker;A;12:00"], 2)
    places = rng.integers(3, 600, 2)
    return replace(
        rig, edit=lambda lines: _with(lines, dict(zip(places.tolist(), map(str, marks), strict=True)))
    )


def _with(lines: list[str], marks: dict[int, str]) -> list[str]:
    return [each for k, line in enumerate(lines) for each in ([marks[k]] if k in marks else []) + [line]]


def _other_command(rig: Rig, rng: Generator) -> Rig:
    stem = str(rng.choice(list(rig.tests)))
    own = int(stem.rpartition("_")[2][:-2])
    return replace(rig, current={stem: 1e-3 * (own + 500)})


def _swapped_names(rig: Rig, rng: Generator) -> Rig:
    motion = str(rng.choice([stem.rpartition("_")[0] for stem in rig.tests]))
    low, high = (f"{motion}_{current}mA" for current in (0, 1000))
    return replace(rig, tests={**rig.tests, low: rig.tests[high]})


def _constant(rig: Rig, rng: Generator) -> Rig:
    stem, place = str(rng.choice(list(rig.tests))), int(rng.integers(1, 3))
    columns = [np.full_like(each, each[3]) if k == place else each for k, each in enumerate(rig.tests[stem])]
    return replace(rig, tests={**rig.tests, stem: columns})


def _lost_column(rig: Rig, rng: Generator) -> Rig:
    first = int(rng.integers(20, 700))
    return replace(
        rig, edit=lambda rows: [row if k < first else row.rpartition(";")[0] for k, row in enumerate(rows)]
    )


def _without_time(rig: Rig, _: Generator) -> Rig:
    return replace(rig, edit=lambda lines: [line.partition(";")[2] for line in lines])


FAULTS: dict[str, tuple[Plant, str]] = {
    "milliseconds taken for seconds": (_units(0, "ms", "s"), "ms"),
    "metres taken for millimetres": (_units(1, "m", "mm"), "displacement"),
    "millimetres taken for metres": (_units(1, "mm", "m"), "displacement"),
    "kilonewtons taken for newtons": (_units(2, "kN", "N"), "kN"),
    "newtons taken for kilonewtons": (_units(2, "N", "kN"), "N taken for kN"),
    "marker lines": (_markers, "markers=skip"),
    "another command than the name's": (_other_command, "the file name says"),
    "a file under the name of another": (_swapped_names, "check its current"),
    "a constant column": (_constant, "constant"),
    "a lost column": (_lost_column, "field"),
    "no column of times": (_without_time, "200 Hz"),
}


def said_of(rig: Rig) -> Iterator[str]:
    """Refusals and warnings of a rig."""
    with tempfile.TemporaryDirectory() as folder:
        tests = []
        for path in rig.write(Path(folder)):
            try:
                tests.append(read_damper_test(path))
            except MrworkError as error:
                yield str(error)
        findings = [*(each for test in tests for each in test.findings), *findings_of_set(tests)]
        yield from (each.message for each in findings if each.severity == "warning")


def shares(n_rigs: int, seed: int = 71) -> tuple[dict[str, float], list[str]]:
    """Share of each fault that is told, and what is said of as many honest rigs, the first of each."""
    rng = np.random.default_rng(seed)
    each = max(n_rigs // len(FAULTS), 1)
    told = {
        name: float(
            np.mean([any(word in said for said in said_of(plant(honest(rng), rng))) for _ in range(each)])
        )
        for name, (plant, word) in FAULTS.items()
    }
    alarms = [next(said_of(honest(rng)), "") for _ in range(each * len(FAULTS))]
    return told, [said for said in alarms if said]


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    found, false = shares(count)
    for fault, share in found.items():
        print(f"{fault:36} {100.0 * share:5.0f} % told")
    print(f"{len(false)} of {count // len(FAULTS) * len(FAULTS)} honest rigs: {false[:3]}")
