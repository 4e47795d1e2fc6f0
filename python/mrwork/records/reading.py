"""How the tests of a run were read: from files, by columns, window, repairs and samples that count, or embedded ones.

An embedded test is simulated with a published parameter set, given motion, sensor noise and seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from mrwork.base.arguments import Count, Within, checked
from mrwork.base.hints import InUnit
from mrwork.base.keys import look_up
from mrwork.base.values import Floats
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.dampers.spec import damper
from mrwork.errors import MrworkError, RecordError
from mrwork.files.open_table import is_there
from mrwork.records.damper_test import DamperTest
from mrwork.records.read import Origin, read_damper_test, test_from_arrays
from mrwork.records.repairs import RepairKind, repair
from mrwork.records.window import count_samples_from, cut

# Instants of a record may count from a far epoch.
Instant = Annotated[float, Within(least=-1e10, most=1e10), InUnit("s")]
Settle = Annotated[float, Within(least=0.0, most=1e6), InUnit("s")]

# Called with the number of tests that have been read, and of all.
OnRead = Callable[[int, int], None]

_SYNTHETIC = "synthetic:"
# What helps where a refusal suggests options for one of several files.
_OF_ONE_FILE = (
    "--column holds for all files given, so write what is of this one into its row of a table of tests, as "
    "mrwork check FILES --table begins it, or give it alone"
)
_DT = 1e-3
_FORCE_NOISE_N = 8.0
_DISPLACEMENT_NOISE_M = 5e-6
_VELOCITY_NOISE_MPS = 5e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class SyntheticTest:
    """A sinusoidal test of a model with its nominal, published parameters, from rest at mid-stroke."""

    model: str
    amplitude: float
    frequency: float
    cycles: int
    rng: int


SYNTHETIC_TESTS = {
    "spencer1997": SyntheticTest(model="bouc_wen", amplitude=0.015, frequency=2.5, cycles=5, rng=1997),
    "spencer1997_slow": SyntheticTest(model="bouc_wen", amplitude=0.025, frequency=0.5, cycles=2, rng=1998),
    "spencer1997_fast": SyntheticTest(model="bouc_wen", amplitude=0.004, frequency=5.0, cycles=10, rng=1999),
    "rd1005_1a": SyntheticTest(model="static_hysteretic", amplitude=0.010, frequency=1.0, cycles=4, rng=2006),
}


@checked
def synthetic_test(name: str) -> DamperTest:
    """Generate the synthetic test with this name; the same name gives the same bits.

    The force is simulated for the exact motion. White sensor noise is then added, with standard deviations of 8 N for
    the force, 5 um for the displacement and 0.5 mm/s for the velocity.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.synthetic_test("spencer1997").n_time
    2001
    """
    recipe = look_up(name, SYNTHETIC_TESTS, f"no synthetic test is called {name!r}")
    spec = damper(recipe.model)
    omega = 2.0 * np.pi * recipe.frequency
    time = _DT * np.arange(round(recipe.cycles / recipe.frequency / _DT) + 1)
    displacement = recipe.amplitude * np.sin(omega * time)
    velocity = recipe.amplitude * omega * np.cos(omega * time)
    force = simulate_force(spec, spec.nominal, Loading(dt=_DT, displacement=displacement, velocity=velocity))
    rng = np.random.default_rng(recipe.rng)

    def noise(deviation: float) -> Floats:
        return deviation * rng.standard_normal(time.size)

    return test_from_arrays(
        name=f"synthetic {name}",
        time=time,
        displacement=displacement + noise(_DISPLACEMENT_NOISE_M),
        velocity=velocity + noise(_VELOCITY_NOISE_MPS),
        force=force + noise(_FORCE_NOISE_N),
        amplitude=recipe.amplitude,
        frequency=recipe.frequency,
        synthetic=True,
        origin=Origin(path=f"{_SYNTHETIC}{name}"),
    )


def is_synthetic(file: str) -> bool:
    """Whether a test is one of the embedded ones, and no file."""
    return file.startswith(_SYNTHETIC)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Files of one run and how each was processed: window, repairs, start of the samples that count.

    `columns` and `repairs` are as in `read_damper_test` and `repair`, with `None` for a repair that takes no amount;
    `columns_of` are of single files, as a table of tests gives them, and go before `columns`; `facts` are of the
    specimen. Relative `files` are relative to `folder`, or to the current folder.

    Parameters
    ----------
    start
        Use the record from this time on.
    end
        Use the record up to this time.
    every
        Use every N-th sample.
    settle
        Time at the start that is simulated but not compared; default: until the damper has travelled half its
        peak-to-peak stroke.
    keep_velocity
        Use a velocity column also where it is a difference of the displacement, half a sample off, or held over several
        samples; otherwise the velocity is derived from the displacement, and said.
    """

    files: tuple[str, ...]
    folder: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    start: Instant | None = None
    end: Instant | None = None
    every: Count = 1
    repairs: Mapping[RepairKind, float | None] = field(default_factory=dict)
    settle: Settle | None = None
    columns_of: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    keep_velocity: bool = False
    facts: Mapping[str, str] = field(default_factory=dict)

    def tests(self, *, on_read: OnRead | None = None) -> tuple[DamperTest, ...]:
        """Read the files as tests; `on_read` is called before each."""
        tests = []
        for done, file in enumerate(self.files):
            if on_read is not None:
                on_read(done, len(self.files))
            tests.append(self.test_of(file))
        return tuple(tests)

    def test_of(self, file: str) -> DamperTest:
        """Read one of the files with its columns, cut, repaired, thinned and settled; or make a synthetic test."""
        if is_synthetic(file):
            test = synthetic_test(file.removeprefix(_SYNTHETIC))
        else:
            columns = {**self.columns, **self.columns_of.get(file, {})}
            read = partial(
                read_damper_test, self._path(file), columns=columns, keep_velocity=self.keep_velocity
            )
            try:
                try:
                    test = read()
                except RecordError:
                    if (self.start, self.end) == (None, None):
                        raise
                    test = read(start=self.start, end=self.end)  # what is refused may lie outside
            except MrworkError as error:
                if len(self.files) == 1 or not error.of_columns:
                    raise
                raise type(error)(f"{error}; {_OF_ONE_FILE}") from error
        if (self.start, self.end) != (None, None):
            test = cut(test, start=self.start, end=self.end)
        amounts = {kind: amount for kind, amount in self.repairs.items() if amount is not None}
        test, _ = repair(test, self.repairs, amounts=amounts)
        if self.every > 1:  # of pulses every N-th sample shows less
            test = cut(test, every=self.every)
        return test if self.settle is None else count_samples_from(test, self.settle)

    def _path(self, file: str) -> str:
        """Path of a file from the current folder, or else from the folder where it was read."""
        return file if is_there(file) or not self.folder else str(Path(self.folder) / file)
