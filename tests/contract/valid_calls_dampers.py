"""Valid calls on dampers, their design, simulation, records and motions, for tests that make them wrong.

A call is small: wrong arguments that happen to be valid must not take long.
"""

from functools import cache
from pathlib import Path

import numpy as np
from posterior_samples import small_sampling, small_test
from small_damper import SMALL, WISHES

import mrwork as mr
from mrwork import dampers, motions, records
from mrwork.base.summary import named
from mrwork.dampers import design
from mrwork.dampers.simulation import (
    simulate_forces,
    simulate_misfits,
    simulate_sensitivities,
    stiffness_shares,
)
from mrwork.records.read import Origin
from tests.contract.wrong_arguments import Calls, call, calls_with

_N_TIME = 60
_BINGHAM = mr.damper("bingham")
_FIELDS = (
    *("name", "path", "sha256", "dt", "start_time", "displacement", "velocity", "force", "velocity_source"),
    *("n_settle", "amplitude", "frequency", "observation", "remarks"),
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
    yield call(_BINGHAM.with_current_laws, laws={"f_c": "linear"}, unit="A", lag="two_rates")
    yield call(mr.Box, names=("c", "f0"), lower=(1.0, -5.0), upper=(9.0, 5.0), log=(True, False))
    yield call(mr.Box.of(_BINGHAM).with_bounds, bounds={"f_c": (1.0, 2.0)})
    yield call(box.theta_from_unit, unit=np.full((4, len(box.names)), 0.5))
    yield call(box.theta_from_latent, latent=np.zeros(len(box.free)))
    within = {"theta": 0.5 * (np.array(box.lower) + box.upper)}
    yield from calls_with(within, box.unit_slope, box.unit_from_theta, box.latent_from_theta)
    yield from calls_with(within, box.inside)
    facts = {"alpha": 0.1, "ko": 1e5, "n": 2.0, "gamma": 100.0, "beta": 100.0, "Ao": 1.0}
    yield call(dampers.OpenSeesBoucWen, **facts)
    material = dampers.OpenSeesBoucWen(**facts)
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
    fields = ("dt", "displacement", "velocity", "command", "command_unit")
    yield call(mr.Loading, **named(_loading(), *fields))
    yield call(mr.simulate_force, spec=_BINGHAM, theta=theta, loading=_loading(), substep_factor=1)
    yield call(mr.simulate_force, spec=laws, theta=laws.nominal, loading=_loading())
    yield call(dampers.flops_per_step, model=_BINGHAM, theta=theta)
    yield call(dampers.fma_peak, threads=1, seconds=0.001)
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
    signals = named(test, "time", "displacement", "force")
    current = np.full(test.n_time, 0.5)
    values = {
        **{"name": "rig", "velocity": test.velocity, "current": current, "voltage": 1.0, "amplitude": 0.01},
        **{"frequency": 1.0, "synthetic": True, "origin": Origin(path="rig.csv", sha256="0", locate=str)},
    }
    yield call(mr.test_from_arrays, **signals, **values)
    yield call(mr.test_from_arrays, **signals, command=current, command_unit="A", keep_velocity=True)
    yield call(mr.DamperTest, **named(test, *_FIELDS), current=current)
    yield call(test.part, first=2, last=100, every=2)
    yield call(records.cut, test=test, start=0.1, end=1.5, every=2)
    yield call(records.repair, test=test, kinds=["offset"], amounts={"offset": 3.0})
    yield call(records.observed, test=test, observe=["average=0.02", "gain=1.1"])
    observation = records.Observation(delay_seconds=0.02, average_seconds=0.05, lowpass_hz=20.0)
    yield call(observation.observe, force=test.force, dt=test.dt)
    yield call(observation.reach, dt=test.dt)
    yield call(records.guess_tests, files=[record()])
    rows = [records.ListedTest(file=str(record()), use="fit")]
    yield call(records.write_test_table, path=files / "tests.csv", rows=rows)


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

    def road() -> Path:
        path = files / "road.csv"
        np.savetxt(path, np.column_stack([np.arange(50.0), np.zeros(50)]), delimiter=",")
        return path

    target = motions.en_1998_spectrum(2.0, "B")
    yield call(
        mr.GroundMotion,
        **{"name": "a", "dt": 0.01, "acceleration": np.sin(np.arange(50.0)), "source": "", "changes": ("x",)},
        forces=np.ones((2, 50)),
    )
    yield call(motions.force_motion, forces=np.ones((2, 50)), dt=0.01, name="wind", source="tunnel")
    yield call(mr.read_motion, path=accelerogram(), unit="g", dt=0.02)
    yield call(mr.read_motions, paths=[accelerogram(True)], unit="g")
    values = {
        **{"motion": motion, "motions": [motion], "target": target, "kind": "kanai_tajimi", "name": "a"},
        **{"spectrum": motions.KanaiTajimi(), "envelope": motions.Envelope(), "rng": 3, "duration": 2.0},
        **{"dt": 0.04, "peak": 2.0, "soil": ("firm", "soft"), "n": 2, "pulses": "both", "damping": 0.02},
        **{"periods": [0.2, 1.0], "period": 0.5, "by": "sa", "sa": 2.0, "order": 1, "factor": 0.5},
        **{"start": 0.5, "end": 1.5, "amplitude": 1.0, "frequency": 2.0, "cycles": 2.0, "phase": 0.3},
        **{"a_g": 2.0, "ground": "B", "spectrum_type": 2, "s_ds": 10.0, "s_d1": 6.0, "t_l": 8.0},
        "beyond": "scale",
    }
    yield from calls_with(
        values,
        *(mr.synthetic_motion, mr.response_spectrum, motions.suite, motions.en_1998_spectrum),
        *(motions.asce_7_spectrum, motions.scaled_to_target, motions.check_suite),
        *(motions.fitted_spectrum, motions.stationary_ground),
        *(target.acceleration, motions.ShakeTable().demand),
        *(motions.baseline_corrected, motions.scaled, motions.scaled_to_peak),
        *(motions.time_scaled, motions.trimmed, motions.sine, motions.near_fault_pulse),
        *(motions.resampled, motions.ShakeTable().driven),
    )
    yield call(motions.table_spectrum, periods=[0.0, 1.0], accelerations=[2.0, 5.0], name="a", damping=0.02)
    yield call(motions.road_motion, heights=np.sin(np.arange(50.0)), dt=0.01, name="a", source="b")
    yield call(motions.iso_8608_road, road_class="B", speed=20.0, rng=3, duration=2.0, dt=0.005, name="a")
    yield call(motions.read_road, path=road(), speed=20.0, unit="mm", column="2")
    yield call(motions.KanaiTajimi().density, w=np.linspace(0.1, 50.0, 5))


_FLUID, _STEEL = design.fluid("MRF-132DG"), design.steel("AISI 1010")
_SLOT = design.Slot(inner_radius=0.05, gap=0.001, length=0.03)
_WISHES = design.DamperWishes(**WISHES)


def _continue(_: mr.Progress) -> None:
    """A callback that ends nothing."""


@cache
def _circuit() -> design.MagneticCircuit:
    return design.twenty_ton_damper().circuit


def material_calls(_: Path) -> Calls:
    """Fluids, steels, slots and circuits."""
    flow = {"flow": np.array([0.0, 1e-4]), "yield_stress": 1e4, "viscosity": 0.3, "flow_index": 0.9}
    yield call(design.MRFluid, name="mine", particle_fraction=0.3, viscosity=0.1, density=3e3, flow_index=0.9)
    yield call(design.Steel, name="mine", field=(0.0, 300.0), flux_density=(0.0, 0.5))
    flow |= {"slot": _SLOT, "wall_speed": 0.1}
    yield from calls_with(flow, design.pressure_drop)
    parts = {"fluid": _FLUID, "steel": _STEEL, "areas": (3e-4, 4e-4), "lengths": (0.05, 0.06)}
    yield call(design.MagneticCircuit, **parts, gap_area=5e-4, turns=200, gap=1e-3)
    yield call(_circuit().ampere_turns, field=np.array([0.0, 1e5]))
    currents = {"current": np.array([0.0, 1.0])}
    yield from calls_with(currents, _circuit().field, _circuit().flux, _circuit().inductance)
    yield call(_circuit().rise_time, current=1.0, resistance=7.0, supply=20.0)


def damper_design_calls(_: Path) -> Calls:
    """Designs, their model, and sizing."""
    large = design.twenty_ton_damper()
    yield call(design.DamperDesign, **SMALL)
    yield call(large.force, velocity=np.array([-0.1, 0.0, 0.1]), current=1.0, flow_model="plates")
    yield from calls_with({"current": np.array([0.0, 1.0])}, large.yield_stress, large.inductance)
    yield call(large.response_time, supply=100.0)
    yield call(large.as_model, supply=100.0)
    further = {"response_time": 1.0, "current_density": 4e6, "stress": 1e8, "least_gap": 5e-4}
    yield call(design.DamperWishes, **WISHES, **further, friction=10.0)
    yield call(_WISHES.missed, design=large)
    values = {"wishes": _WISHES, "fluid": _FLUID, "steel": _STEEL, "rng": 0, "on_progress": _continue}
    yield from calls_with({**values, "search": "differential_evolution", "budget": 60}, design.size_damper)


ROOMS = (damper_calls, simulation_calls, record_calls, motion_calls, material_calls, damper_design_calls)
