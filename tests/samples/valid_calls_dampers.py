"""Valid calls on dampers, their simulation, records and motions, for tests that make them wrong.

A call is small: wrong arguments that happen to be valid must not take long.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from posterior_samples import small_sampling, small_test
from wrong_arguments import Calls, call, calls_with

import mrwork as mr
from mrwork import dampers, motions, records
from mrwork.dampers.simulation import (
    simulate_forces,
    simulate_misfits,
    simulate_sensitivities,
    stiffness_shares,
)

_N_TIME = 60
_BINGHAM = mr.damper("bingham")
_FIELDS = (
    *("name", "path", "sha256", "dt", "start_time", "displacement", "velocity", "force", "velocity_source"),
    *("n_settle", "amplitude", "frequency", "observation", "findings"),
)


@cache
def _loading() -> mr.Loading:
    time = 0.01 * np.arange(_N_TIME)
    return mr.Loading(
        dt=0.01,
        displacement=0.01 * np.sin(6.0 * time),
        velocity=0.06 * np.cos(6.0 * time),
        command=np.full(_N_TIME, 0.5),
        command_unit="A",
    )


@cache
def _motion() -> mr.GroundMotion:
    return mr.synthetic_motion(duration=6.0, dt=0.02, peak=3.0)


def damper_calls(_: Path) -> Calls:
    """Models, boxes and conversions."""
    box = small_sampling().target.form.box
    bouc_wen = mr.damper("bouc_wen").nominal
    yield call(_BINGHAM.with_current_laws, laws={"f_c": "linear"}, unit="A", lagged=True)
    yield call(mr.Box, names=("c", "f0"), lower=(1.0, -5.0), upper=(9.0, 5.0), log=(True, False))
    yield call(mr.Box.of(_BINGHAM).with_bounds, bounds={"f_c": (1.0, 2.0)})
    yield call(box.theta_from_unit, unit=np.full((4, len(box.names)), 0.5))
    yield call(box.unit_slope, theta=np.array(box.lower))
    yield call(box.unit_from_theta, theta=np.array(box.lower))
    yield call(box.theta_from_latent, latent=np.zeros(len(box.free)))
    yield call(box.latent_from_theta, theta=0.5 * (np.array(box.lower) + box.upper))
    yield call(box.inside, theta=np.array(box.lower))
    yield call(box.contains, theta=np.array(box.lower))
    yield call(dampers.OpenSeesBoucWen, alpha=0.1, ko=1e5, n=2.0, gamma=100.0, beta=100.0, Ao=1.0)
    material = dampers.OpenSeesBoucWen(alpha=0.1, ko=1e5, n=2.0, gamma=100.0, beta=100.0, Ao=1.0)
    yield call(material.strain_step, error=0.005)
    yield call(dampers.bouc_wen_from_opensees, material=material, c0=10.0)
    yield call(dampers.opensees_from_bouc_wen, theta=bouc_wen * (np.arange(8) != 2), Ao=1.0)
    yield call(dampers.normalised_from_bouc_wen, theta=bouc_wen)
    yield call(dampers.bouc_wen_from_normalised, theta=mr.damper("normalised_bouc_wen").nominal, A=1.0)


def simulation_calls(_: Path) -> Calls:
    """Simulations of one damper or of a batch."""
    theta = _BINGHAM.nominal
    rows = np.tile(theta, (3, 1))
    laws = _BINGHAM.with_current_laws({"f_c": "linear"})
    history = _loading().history()
    yield call(
        mr.Loading,
        dt=0.01,
        displacement=_loading().displacement,
        velocity=_loading().velocity,
        command=_loading().command,
        command_unit="A",
    )
    yield call(mr.simulate_force, spec=_BINGHAM, theta=theta, loading=_loading(), substep_factor=1)
    yield call(mr.simulate_force, spec=laws, theta=laws.nominal, loading=_loading())
    values = {
        **{"spec": _BINGHAM, "theta": rows, "history": history, "force": np.ones(_N_TIME), "first": 2},
        **{"limits": np.full(3, 1e9), "substep_factor": 1, "columns": [0, 1], "threads": 1},
    }
    yield from calls_with(values, simulate_misfits, simulate_forces, stiffness_shares, simulate_sensitivities)


def record_calls(files: Path) -> Calls:
    """Damper tests, read, built and repaired."""
    test = small_test()

    def record() -> Path:
        path = files / "rig.csv"
        test = small_test()
        columns = np.column_stack([test.time, test.displacement, test.force])
        np.savetxt(path, columns, delimiter=",", header="t_s,displacement_m,force_N", comments="")
        return path

    yield call(mr.read_damper_test, path=record(), columns={"force": "force_N:kN"}, keep_velocity=True)
    yield call(mr.read_damper_tests, paths=[record()], columns={"force": "force_N:kN"}, keep_velocity=True)
    yield call(
        records.build_damper_test,
        name="rig",
        time=test.time,
        displacement=test.displacement,
        force=test.force,
        velocity=test.velocity,
        current=np.full(test.n_time, 0.5),
        voltage=1.0,
        amplitude=0.01,
        frequency=1.0,
        synthetic=True,
        path="rig.csv",
        sha256="0",
        locate=str,
    )
    yield call(
        mr.test_from_arrays,
        time=test.time,
        displacement=test.displacement,
        force=test.force,
        command=np.full(test.n_time, 0.5),
        command_unit="A",
        keep_velocity=True,
    )
    yield call(
        mr.DamperTest, **{name: getattr(test, name) for name in _FIELDS}, current=np.full(test.n_time, 0.5)
    )
    yield call(test.part, first=2, last=100, every=2)
    yield call(records.cut, test=test, start=0.1, end=1.5, every=2)
    yield call(records.repair, test=test, kinds=["offset"], amounts={"offset": 3.0})
    yield call(records.observed, test=test, observe=["average=0.02", "gain=1.1"])
    yield call(
        records.Observation(delay_seconds=0.02, average_seconds=0.05, lowpass_hz=20.0).observe,
        force=test.force,
        dt=test.dt,
    )
    yield call(records.Observation(delay_seconds=0.02, average_seconds=0.05).reach, dt=test.dt)
    yield call(records.guess_tests, files=[record()])
    yield call(
        records.write_test_table,
        path=files / "tests.csv",
        rows=[records.ListedTest(file=str(record()), use="fit")],
    )


def motion_calls(files: Path) -> Calls:
    """Ground motions."""
    motion = _motion()

    def accelerogram(timed: bool = False) -> Path:
        path = files / ("timed.csv" if timed else "motion.csv")
        columns = [_motion().time, _motion().acceleration][0 if timed else 1 :]
        np.savetxt(
            path, np.column_stack(columns), delimiter=",", header="t_s,a_g" if timed else "", comments=""
        )
        return path

    yield call(
        mr.GroundMotion, name="a", dt=0.01, acceleration=np.sin(np.arange(50.0)), source="", changes=("x",)
    )
    yield call(mr.read_motion, path=accelerogram(), unit="g", dt=0.02)
    yield call(mr.read_motions, paths=[accelerogram(True)], unit="g")
    yield call(
        mr.synthetic_motion,
        spectrum=motions.KanaiTajimi(),
        rng=3,
        duration=2.0,
        dt=0.02,
        envelope=motions.Envelope(),
        peak=2.0,
        name="a",
    )
    yield call(motions.suite, soil=("firm", "soft"), n=2, rng=0, pulses="both", peak=2.0, dt=0.05, name="a")
    yield call(mr.response_spectrum, motion=motion, periods=[0.2, 1.0], damping=0.05)
    target = motions.en_1998_spectrum(2.0, "B")
    yield call(motions.en_1998_spectrum, a_g=2.0, ground="B", spectrum_type=2, damping=0.02)
    yield call(motions.asce_7_spectrum, s_ds=10.0, s_d1=6.0, t_l=8.0)
    yield call(motions.table_spectrum, periods=[0.0, 1.0], accelerations=[2.0, 5.0], name="a", damping=0.02)
    yield call(target.acceleration, periods=[0.0, 1.0])
    yield call(motions.scaled_to_target, motion=motion, target=target, by="sa", period=0.5)
    yield call(motions.check_suite, motions=[motion], target=target, period=0.5)
    yield call(motions.scaled_to_sa, motion=motion, sa=2.0, period=0.5, damping=0.05)
    yield call(motions.fitted_spectrum, motion=motion, kind="kanai_tajimi")
    yield call(motions.stationary_ground, motions=[motion], kind="kanai_tajimi", frequency=15.0, damping=0.6)
    values = {"motion": motion, "order": 1, "dt": 0.04, "factor": 0.5, "peak": 2.0, "start": 0.5, "end": 1.5}
    yield from calls_with(
        values,
        *(motions.baseline_corrected, motions.resampled_band_limited, motions.scaled, motions.scaled_to_peak),
        *(motions.time_scaled, motions.trimmed),
    )
    yield call(motions.resampled, motion=motion, dt=0.01)
    yield call(motions.sine, amplitude=1.0, frequency=2.0, cycles=2.0, dt=0.01)
    yield call(motions.sine_sweep, amplitude=1.0, start=1.0, end=3.0, duration=2.0, dt=0.01)
    yield call(motions.near_fault_pulse, amplitude=1.0, period=1.0, cycles=1.5, phase=0.3, dt=0.02)
    yield call(motions.KanaiTajimi().density, w=np.linspace(0.1, 50.0, 5))
    yield call(motions.ShakeTable().gain, frequency=[1.0, 10.0])
    yield call(motions.ShakeTable().demand, motion=motion)
    yield call(motions.ShakeTable().driven, motion=motion, beyond="scale")


ROOMS = (damper_calls, simulation_calls, record_calls, motion_calls)
