"""The damper identified from the sine tests, and the rate of its driver from a step of the current."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import curve_fit

import mrwork as mr
from mrwork.closed_loop import Fault
from studies.chapter_7.sine_tests import PEAKS, SineTest, Wanted, damper_test, sine_tests
from studies.chapter_7.virtual_rig import (
    DRIVER_RATE,
    LARGEST_CURRENT,
    LAWS,
    SENSORS,
    Rig,
    Sensors,
    damper_of,
    recorded,
    signals_of,
)
from studies.former.scores import constant_commands

# Time at which the driver is switched on [s].
_SWITCHED_ON = 0.05
# Where x_s is looked for [m]: above what the sensor resolves, below the amplitude of every test. Without the upper
# bound the search can end in a minimum where no test changes sides.
_SIDE = (1e-5, 1e-3)
FEW_HARMONICS = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedDamper:
    """The sine tests, the fit of the current laws, and the rate of the driver [1/s] with its standard error."""

    measured: list[SineTest]
    tests: tuple[mr.DamperTest, ...]
    fit: mr.Fit
    rate: float
    rate_error: float

    @property
    def device(self) -> mr.Device:
        """The damper as it was identified."""
        return damper_of(self.fit.theta, rate=self.rate)


def identified_damper(
    rig: Rig,
    wanted: list[Wanted],
    rng: np.random.Generator,
    *,
    sensors: Sensors = SENSORS,
    threads: int,
) -> IdentifiedDamper:
    """Fit the current laws to all sine tests together; the driver's rate is that of the recorded current."""
    measured = sine_tests(rig, wanted, rng, sensors=sensors, threads=threads)
    tests = tuple(damper_test(test) for test in measured)
    fit = fitted(tests, bounds={"x_s": _SIDE}, threads=threads)
    rate, error = driver_rate(rig, rng, sensors)
    return IdentifiedDamper(measured=measured, tests=tests, fit=fit, rate=rate, rate_error=error)


def fitted(
    tests: tuple[mr.DamperTest, ...], *, bounds: dict[str, tuple[float, float]], threads: int
) -> mr.Fit:
    """The current laws of the static hysteretic model."""
    spec = mr.damper("static_hysteretic").with_current_laws(LAWS, unit="A")
    return mr.identify(spec, tests, bounds=bounds, rng=0, threads=threads)


def other_ways(found: IdentifiedDamper, *, threads: int) -> dict[str, mr.Fit]:
    """The fit of the study, and fits with one of its precautions left out, to the same records."""
    few = tuple(damper_test(test, FEW_HARMONICS) for test in found.measured)
    large = tuple(
        test
        for test, each in zip(found.tests, found.measured, strict=True)
        if each.wanted.peak == PEAKS[each.wanted.current]
    )
    bounds = {"x_s": _SIDE}
    return {
        "as in the study": found.fit,
        f"{FEW_HARMONICS} harmonics": fitted(few, bounds=bounds, threads=threads),
        "no small tests": fitted(large, bounds=bounds, threads=threads),
        "no small tests, no bounds on x_s": fitted(large, bounds={}, threads=threads),
        "no bounds on x_s": fitted(found.tests, bounds={}, threads=threads),
    }


def figures_of_ways(fits: dict[str, mr.Fit], truth: mr.Device) -> dict[str, Any]:
    """Fit and telling coefficients of each way, and the truth, whose fit is that of nobody."""
    names = fits["as in the study"].spec.names
    found: dict[str, Any] = {
        "true": {"coefficients": dict(zip(names, truth.draws[0].tolist(), strict=False))}
    }
    for way, fit in fits.items():
        found[way] = {
            "fit_percent": fit.fit_percent,
            "warnings": len(fit.warnings),
            "coefficients": {each.name: each.value for each in fit.estimates},
        }
    return found


def driver_rate(rig: Rig, rng: np.random.Generator, sensors: Sensors) -> tuple[float, float]:
    """Rate of `i = i_max (1 - exp(-eta (t - t_on)))` after the command is switched on, and its standard error."""
    still = mr.GroundMotion(name="still", dt=1e-3, acceleration=np.zeros(201))
    law = constant_commands(LARGEST_CURRENT)
    off = Fault(channel="command", start=0.0, end=_SWITCHED_ON, value=0.0)
    switched = replace(rig, hardware=replace(rig.hardware, faults=(off,)))
    (signals,) = signals_of(switched, law, [still])
    seen = recorded(signals, rng, sensors)
    late = seen.time >= _SWITCHED_ON + rig.hardware.delay

    def rising(time: np.ndarray, rate: float, end: float) -> np.ndarray:
        return np.asarray(end * (1.0 - np.exp(-rate * time)))

    since = seen.time[late] - _SWITCHED_ON - rig.hardware.delay
    found, covariance = curve_fit(rising, since, seen.current[late], p0=(100.0, LARGEST_CURRENT))
    return float(found[0]), float(np.sqrt(covariance[0, 0]))


def figures_of(found: IdentifiedDamper, truth: mr.Device) -> dict[str, Any]:
    """Coefficients with standard errors beside the truth, quality, and the driver."""
    estimates = {each.name: each for each in found.fit.estimates}
    true = dict(zip(estimates, truth.draws[0].tolist(), strict=False))
    return {
        "coefficients": {
            name: {"identified": each.value, "standard_error": each.standard_error, "true": true[name]}
            for name, each in estimates.items()
        },
        "fit_percent": found.fit.fit_percent,
        "worst_nrmse": max(each.nrmse for each in found.fit.quality),
        "rate": {"identified": found.rate, "standard_error": found.rate_error, "true": DRIVER_RATE},
        "tests": len(found.tests),
    }
