"""A result of each type that figures take, made in little time."""

import tempfile
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import study_samples
from loop_samples import devices, five_storeys, rd1005
from posterior_samples import MODEL, small_fit, small_test
from run_folders import write_fit
from sinusoidal_tests import driven_test, harmonic

import mrwork as mr
from mrwork.errors import MrworkWarning
from mrwork.identification import Race
from mrwork.records.reading import Reading
from mrwork.study.least_counts import RowCount, TriedCounts
from mrwork.tuning import Front
from mrwork.tuning.judging import with_tuning
from mrwork.tuning.tuned_laws import FrontPoint
from mrwork.uncertainty.bands.calibration_files import StoredBands

_QUICK = Race(samples=20, starts=2, most_rounds=1)


@cache
def fit_with_laws() -> mr.Fit:
    """Three tests of a damper whose friction and damping follow the current."""
    spec = mr.damper("bingham").with_current_laws({"f_c": "linear", "c0": "linear"}, unit="A")
    known = {"f_c.0": 100.0, "f_c.1": 400.0, "v_s": 0.005, "c0.0": 500.0, "c0.1": 300.0, "f0": 0.0}
    theta = [known[name] for name in spec.names]
    tests = [moved_test(spec, theta, command) for command in (0.0, 0.7, 1.5)]
    return mr.identify(spec, tests, search=_QUICK, rng=1)


def moved_test(spec: mr.DamperSpec, theta: list[float], command: float) -> mr.DamperTest:
    """Two cycles at a current."""
    shape = {"dt": 5e-3, "n_time": 201, "noise_n": 3.0, "rng": 1}
    return driven_test(spec, theta, (0.01, 2.0), **shape, command=command)


@cache
def switched_test() -> mr.DamperTest:
    """A test whose current is switched on and off."""
    test = small_test()
    return replace(test, current=np.where(test.time % 1.0 < 0.5, 0.0, 1.5))


@cache
def other_test(frequency: float = 2.0, factor: float = 1.1) -> mr.DamperTest:
    """A test at another frequency than that of the fit, of a damper that is stronger by a factor."""
    time = 0.01 * np.arange(150)
    loading = harmonic(time, (0.005, frequency))
    force = factor * mr.simulate_force(mr.damper(MODEL), small_fit().theta, loading)
    channels = {"displacement": loading.displacement, "velocity": loading.velocity, "force": force}
    return mr.test_from_arrays(name=f"{frequency:g} Hz", time=time, **channels)


@cache
def predictions() -> tuple[mr.Prediction, ...]:
    """Of tests at other frequencies than that of the fit, with their commands."""
    tests = [other_test(2.0 + number, 1.05 + 0.05 * number) for number in range(3)]
    return tuple(
        mr.predict(small_fit(), replace(test, current=float(number))) for number, test in enumerate(tests)
    )


@cache
def calibration() -> mr.Calibration:
    return mr.calibrate(list(predictions()[1:]), held_out="the fit has not seen")


@cache
def draws() -> mr.Draws:
    return mr.sample(small_fit(), small_test(), walkers=16, most_steps=40, tempering="effective", threads=1)


@cache
def profiles() -> Any:
    return mr.profile(small_fit(), small_test(), parameters=["k_w", "rho"], threads=1)


@cache
def run() -> mr.StoredRun:
    """A run folder of a fit of a file with a current, and what later verbs add to one."""
    test, folder = small_test(), Path(tempfile.mkdtemp())
    columns = {
        "time_s": test.time,
        "displacement_m": test.displacement,
        "velocity_m_per_s": test.velocity,
        "force_N": test.force,
        "current_A": np.where(test.time % 1.0 < 0.5, 0.5, 1.5),
    }
    lines = [columns, *np.stack([*columns.values()], axis=1).tolist()]
    (folder / "test.csv").write_text("\n".join(",".join(map(str, line)) for line in lines))
    reading = Reading(files=(str(folder / "test.csv"),))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MrworkWarning)  # no parameter follows the current
        fit = mr.identify(MODEL, reading.tests(), search=_QUICK, rng=1)
    fit = fit.with_command("mrwork identify", reading)
    place = folder / "run"
    write_fit(place, fit)
    bands = StoredBands(calibration=calibration(), predictions=predictions())
    return replace(mr.load(place), draws=draws(), profiles=profiles(), bands=bands)


@cache
def run_with_laws() -> mr.StoredRun:
    """A run whose fit has current laws."""
    return replace(run(), fit=fit_with_laws())


@cache
def responses(*draws: float) -> mr.Responses:
    """Three candidates under two motions, with histories; each draw of the dampers is a share of their parameters."""
    spec, theta = rd1005()
    frame = five_storeys()
    pair = devices((spec, np.multiply.outer(draws, theta) if draws else theta), of=frame)
    law = mr.ControlLaw(name="passive", gains={"command": [[0.0, 0.0], [0.5, 1.0], [1.5, 1.0]]})
    motions = [
        mr.synthetic_motion(rng=seed, duration=1.0, peak=3.0, name=f"motion {seed}") for seed in (1, 2)
    ]
    return mr.simulate_loop(frame, pair, law, motions, histories=True)


def history() -> mr.closed_loop.History:
    histories = responses().histories
    assert histories is not None
    return histories[-1]


def motion() -> mr.GroundMotion:
    return mr.synthetic_motion(rng=1, duration=2.0)


def front() -> Front:
    """Three points of a law."""
    points = tuple(
        FrontPoint(
            settings={"control_weight": weight},
            train={"peak_drift": drift, "rms_drift": 1.0 - drift},
            test={"peak_drift": 1.1 * drift, "rms_drift": 1.1 - drift},
            certificate="",
        )
        for weight, drift in ((1e-9, 0.6), (1e-8, 0.7), (1e-7, 0.9))
    )
    objectives = ("peak_drift", "rms_drift")
    return Front(law="clipped_optimal", label="A", objectives=objectives, points=points, candidates=8)


def tuning(*fronts: Front) -> mr.TuningResults:
    facts = {"title": "Small", "status": "finished", "command_unit": "A"}
    return mr.TuningResults(laws=(), references=(), **facts, training=("one",), fronts=fronts)


def damper_counts() -> mr.study.DamperCounts:
    """Two rows, of which one keeps a drift of 10 mm."""
    rows = (
        ("Optimal passive", "best_passive", (2, 2), lambda count: 0.016 / count),
        ("Lyapunov", "controller", (1, 1), lambda count: 0.014 + 1e-3 * count),
    )
    return mr.study.DamperCounts(
        criterion="peak_drift",
        limit=0.01,
        unit="m",
        by="uniform",
        most=4,
        bare=0.02,
        rows=tuple(
            RowCount(
                label=label,
                kind=kind,
                keeps=value(counts[0]) <= 0.01,
                places=("one", "other"),
                counts=counts,
                value=value(counts[0]),
                total=float(sum(counts)),
                unit="dampers",
                tried=tuple(TriedCounts(counts=(count, count), value=value(count)) for count in (1, 2, 4)),
            )
            for label, kind, counts, value in rows
        ),
        runs=100,
    )


RESULTS: dict[str, Callable[[], Any]] = {
    "Fit": fit_with_laws,
    "StoredRun": run,
    "Prediction": lambda: predictions()[0],
    "DamperTest": switched_test,
    "Draws": draws,
    "Profiles": profiles,
    "Profile": lambda: profiles().profiles[0],
    "History": history,
    "Responses": responses,
    "StudyResults": study_samples.results,
    "Fragilities": lambda: mr.fragility(study_samples.incremental(), {"peak_drift": "20 mm"}),
    "DamperCounts": damper_counts,
    "GroundMotion": motion,
    "Building": lambda: mr.building("uts"),
    "Pushover": lambda: mr.buildings.pushover(
        mr.buildings.with_storeys_that_yield(mr.building("uts"), yield_drift=0.005), steps=20
    ),
    "SuiteCheck": lambda: mr.motions.check_suite(
        [motion()], mr.motions.en_1998_spectrum(2.0, "B"), period=0.5
    ),
    "ResponseSpectrum": lambda: mr.response_spectrum(motion(), np.linspace(0.1, 2.0, 20)),
    "Front": front,
    "TuningResults": lambda: tuning(front()),
    "TunedStudy": lambda: with_tuning(study_samples.results(), tuning(front())),
}
"""By the name of the type."""
