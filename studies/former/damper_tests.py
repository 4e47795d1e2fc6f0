"""The tests of the study: two synthetic dampers whose truth is known, and a measured one where its records are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import mrwork as mr
from mrwork.dampers import DamperSpec, LawName
from mrwork.records import AS_IT_IS, DamperTest, build_damper_test, cut, observed
from studies.former.arrays import Floats
from studies.former.damper import driven

CURRENTS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
FREQUENCIES = (1.0, 2.0)
AMPLITUDE = 0.010
CYCLES = 4
SAMPLES_PER_CYCLE = 250
FORCE_NOISE_N = 8.0
# Stands in for the sgn(x) of the published form.
SIDE_M = 1e-4

STATIC_LAWS: dict[str, LawName] = {
    "c": "linear",
    "k": "linear",
    "alpha": "quadratic",
    "delta": "linear",
    "f0": "linear",
}
# Published polynomials of the RD-1005-3 in the current [A] (Kwok et al. 2006), lowest power first.
RD_1005_3: dict[str, tuple[float, ...]] = {
    "c": (1232.0, 1929.0),
    "k": (5100.0, -1700.0),
    "alpha": (32.0, 918.0, -244.0),
    "beta": (100.0,),
    "delta": (0.58, 0.30),
    "x_s": (SIDE_M,),
    "f0": (57.0, -18.0),
}


Element = tuple[DamperSpec, Floats]
"""A model with current laws and its coefficients, shape (n_params,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TestSet:
    """Tests of one damper under one harmonic motion, a test per current, lowest first.

    `coefficients` are those of the static hysteretic model where that is the truth.
    """

    __test__ = False

    damper: str
    motion: str
    synthetic: bool
    tests: tuple[DamperTest, ...]
    coefficients: dict[str, tuple[float, ...]] | None = None

    @property
    def name(self) -> str:
        return f"{self.damper}, {self.motion}"

    @property
    def currents(self) -> Floats:
        """Amperes, shape (n_currents,)."""
        return np.array([test.current for test in self.tests], dtype=np.float64)

    def relative(self, rms_n: Floats) -> float:
        """RMS errors [N], shape (n_currents,), each over the standard deviation of its force, root mean square."""
        deviation = np.array([np.std(test.force[test.counted]) for test in self.tests])
        return float(np.sqrt(np.mean((rms_n / deviation) ** 2)))


def rd_1005_3() -> tuple[Element, ...]:
    """The static hysteretic model with the published polynomials."""
    return (driven("static_hysteretic", RD_1005_3),)


def two_stage() -> tuple[Element, ...]:
    """A sharp Bouc-Wen and a broad Dahl element in parallel: none of the models of the chapter.

    Our own numbers, of the size of the RD-1005-3.
    """
    sharp = {
        "c": (1200.0, 1500.0),
        "k": 1500.0,
        "x0": -0.02,
        "k_w": (40.0, 800.0, -220.0),
        "rho": 4000.0,
        "sigma": 0.8,
        "n": 1.3,
    }
    return driven("normalised_bouc_wen", sharp), driven("dahl", {"k_w": (40.0, 300.0), "rho": 150.0})


def synthetic_sets(
    *, seed: int, currents: tuple[float, ...] = CURRENTS, frequencies: tuple[float, ...] = FREQUENCIES
) -> tuple[TestSet, ...]:
    """Both synthetic dampers at every frequency, with white noise on the force only.

    Noise on the motion would bias steep models, so that even the true one had a residual above the noise.
    """
    known = (
        ("synthetic static", rd_1005_3(), RD_1005_3),
        ("synthetic two-stage", two_stage(), None),
    )
    return tuple(
        TestSet(
            damper=damper,
            motion=f"{1e3 * AMPLITUDE:g} mm {frequency:g} Hz",
            synthetic=True,
            coefficients=coefficients,
            tests=tuple(
                _synthetic_test(
                    f"{damper} {frequency:g} Hz {current:g} A",
                    elements,
                    frequency,
                    current,
                    np.random.default_rng([seed, place, round(100 * frequency), round(100 * current)]),
                )
                for current in currents
            ),
        )
        for place, (damper, elements, coefficients) in enumerate(known)
        for frequency in frequencies
    )


def _synthetic_test(
    name: str, elements: tuple[Element, ...], frequency: float, current: float, rng: np.random.Generator
) -> DamperTest:
    dt = 1.0 / (frequency * SAMPLES_PER_CYCLE)
    time = dt * np.arange(CYCLES * SAMPLES_PER_CYCLE + 1)
    omega = 2.0 * np.pi * frequency
    loading = mr.Loading(
        dt=dt,
        displacement=AMPLITUDE * np.sin(omega * time),
        velocity=AMPLITUDE * omega * np.cos(omega * time),
        command=current,
        command_unit="A",
    )
    force = sum(mr.simulate_force(spec, theta, loading) for spec, theta in elements)
    return build_damper_test(
        name=name,
        time=time,
        displacement=loading.displacement,
        velocity=loading.velocity,
        force=force + FORCE_NOISE_N * rng.standard_normal(time.size),
        current=current,
        amplitude=AMPLITUDE,
        frequency=frequency,
        synthetic=True,
        path=f"synthetic:{name}",
    )


def measured_sets(folder: Path) -> tuple[TestSet, ...]:
    """Cycles 3 to 6 of UTFSM tests; none where they are absent.

    By the third cycle the force without current has settled. The authors averaged the force over a tenth of a
    period: the models' force is averaged alike, then compared without averaging. One motion is there unaveraged, too.
    """
    averaged = (
        *_measured(folder, "10mm1Hz*A.csv", "measured UTFSM", "10 mm 1 Hz"),
        *_measured(folder, "5mm3Hz*A.csv", "measured UTFSM", "5 mm 3 Hz"),
    )
    ignored = (
        replace(
            tests,
            damper="measured UTFSM, averaging ignored",
            tests=tuple(replace(test, observation=AS_IT_IS) for test in tests.tests),
        )
        for tests in averaged
    )
    unaveraged = _measured(folder, "unfiltered_5mm3Hz*A.csv", "measured UTFSM, not averaged", "5 mm 3 Hz")
    return (*averaged, *ignored, *unaveraged)


def _measured(folder: Path, pattern: str, damper: str, motion: str) -> tuple[TestSet, ...]:
    if not any(folder.glob(pattern)):
        return ()
    settled = tuple(_settled(test) for test in by_current(folder, pattern))
    return (TestSet(damper=damper, motion=motion, synthetic=False, tests=settled),)


def by_current(folder: Path, pattern: str) -> list[DamperTest]:
    """The tests of files, lowest current first, with the velocity that stands in them."""
    return sorted(mr.read_damper_tests(folder / pattern, keep_velocity=True), key=_current)


def _current(test: DamperTest) -> float:
    if test.current is None:
        raise mr.MrworkError(f"{test.path}: no current is known; give a column current_a or name it ...1A")
    return test.current


def _settled(test: DamperTest) -> DamperTest:
    if test.frequency is None:
        raise mr.MrworkError(f"{test.path}: no frequency is known; name the file like 10mm1Hz0x5A")
    test = observed(test, ["detect"])
    start = test.start_time + 2.0 / test.frequency
    # The quarter is what is simulated but not compared.
    end = start + (CYCLES + 0.25) / test.frequency
    every = max(1, int(1.0 / (test.frequency * test.dt * SAMPLES_PER_CYCLE)))
    return cut(test, start=start, end=end, every=every)
