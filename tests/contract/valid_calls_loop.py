"""Valid calls on buildings, control, the loop and studies, for tests that make them wrong."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from loop_samples import devices, five_storeys, rd1005, sweep
from study_samples import results

import mrwork as mr
from mrwork.base.summary import named
from mrwork.control.laws.fuzzy import fuzzy_table
from mrwork.control.linear.lqr import weighed_state
from mrwork.control.linear.plant import Outputs, stack_outputs
from tests.contract.wrong_arguments import Calls, call, calls_with


def _own(sample: object, memory: object, settings: object) -> object:
    return settings


def _viscous(sample: mr.closed_loop.LoopSample, _: np.ndarray) -> np.ndarray:
    return np.abs(sample.rate)


def buildings_calls(_: Path) -> Calls:
    """Buildings, and what is built into them."""
    of, frame = mr.buildings, five_storeys()
    names = "mass damping stiffness influence floors storeys floor_names storey_names"
    facts = named(frame, *names.split()) | {"name": "x", "source": "s", "status": "ours"}
    yield call(mr.Building, **facts, n_strokes=0)
    yield call(frame.state_matrices, rows=frame.storeys)
    tall = replace(frame, heights=np.full(5, 3.0))
    yield call(
        of.with_storeys_that_yield, building=frame, yield_drift=0.01, post_yield_ratio=0.05, sharpness=5.0
    )
    yield call(of.with_p_delta, building=tall)
    yield call(of.pushover, building=tall, pattern="uniform", roof=0.1, steps=10)
    yield call(frame.storey_row, storey=1)
    yield call(of.ideal_actuator, name="x", row=frame.storeys[0], largest_force=1e3)
    shear = {"masses": [1.0, 2.0], "stiffnesses": [100.0, 200.0], "storey_damping": [1.0, 1.0]}
    shear |= {"floor_names": ["a", "b"], "storey_names": ["c", "d"]}
    yield call(of.shear_building, name="x", **shear, source="s", status="ours")
    yield call(of.with_modal_damping, building=frame, ratios=[0.02] * 5)
    yield call(of.static_condensation, building=frame, shortest_period=1e-3, keep=frame.storeys)
    values = {
        **{"building": frame, "storey": 1, "floor": 5, "mode": 1, "n_modes": 2, "name": "added"},
        **{"a0": 0.1, "a1": 1e-4, "ratios": (0.02, 0.03), "modes": (1, 3), "tuning": "sadek"},
        **{"mass": 20.0, "stiffness": 1e6, "damping": 100.0, "frequency": 3.0, "period": 2.0, "ratio": 0.1},
        **{"yield_force": 800.0, "yield_displacement": 2e-3, "post_yield_ratio": 0.1, "sharpness": 5.0},
        **{"slip_load": 500.0, "head_loss": 4.0, "width_ratio": 0.7, "mass_ratio": 0.02, "rms_velocity": 0.1},
    }
    yield from calls_with(
        values,
        *(of.modal_truncation, of.with_rayleigh_coefficients, of.with_rayleigh_damping),
        *(of.with_viscous_damper, of.with_yielding_damper, of.with_friction_damper, of.with_brace),
        *(of.with_lead_rubber_bearings, of.with_base_isolation, of.with_base_isolation_of_period),
        *(of.with_liquid_column, of.with_optimal_liquid_column),
        *(of.with_tuned_mass, of.with_optimal_tuned_mass),
    )
    element = {"stiffness": 10.0, "damping": 1.0, "head_loss": 2.0, "yield_force": 500.0}
    element |= {"yield_displacement": 1e-3, "sharpness": 5.0, "row": frame.storeys[0]}
    yield call(of.PassiveElement, name="brace that slips", **element)


def plants_calls(_: Path) -> Calls:
    """Plants, observers and surfaces."""
    of, frame = mr.control, five_storeys()
    plant = of.plant_of(frame, frame.storeys[:2])
    outputs = of.drifts(plant)
    measured = stack_outputs(of.accelerations(plant), of.deformations(plant))
    yield call(of.plant_of, building=frame, attachment=frame.storeys[:2], device_names=["a", "b"])
    values = {
        **{"plant": plant, "measurements": measured, "sample_time": 1e-3},
        **{"noise_intensity": np.full(7, 0.02), "unmodelled": 1e-6},
    }
    yield from calls_with(values, of.drifts, of.accelerations, of.deformations, of.observer_of)
    yield call(Outputs, **named(outputs, "names", "C", "D", "G"))
    yield call(of.optimal_surface, plant=plant)


def gains_calls(_: Path) -> Calls:
    """Regulators and matrix equations."""
    of, frame = mr.control, five_storeys()
    plant = of.plant_of(frame, frame.storeys[:2])
    acceleration = of.accelerations(plant)
    C, n = acceleration.C, len(plant.A)
    weighed = weighed_state(plant, plant.energy)
    values = {
        **{"plant": plant, "A": plant.A, "B": plant.B, "C": C, "scaling": plant.scaling},
        **{"outputs": acceleration, "state_weight": plant.energy, "control_weight": 1e-6 * np.eye(2)},
        "cross_weight": np.zeros((n, 2)),
        **{"process_noise": np.eye(n), "sensor_noise": np.eye(5), "cross_noise": np.zeros((n, 5))},
        **{"time": "continuous", "threads": 1, "weight": plant.energy, "weights": np.ones(5)},
        **{"weighed": [weighed, weighed], "control_weights": [1e-7, 1e-6]},
        **{"gain": of.regulator_of_state(plant, plant.energy, 1e-6).gain, "driver_rates": [190.0, None]},
        **{"sample_time": 1e-3, "delay": 2e-3},
    }
    yield from calls_with(
        values,
        *(of.loop_margins, of.regulator_gains, of.kalman_gains, of.lyapunov_solutions, of.lyapunov_function),
        *(of.regulator_of_outputs, of.regulator_of_state, of.regulators_of_weights),
    )
    yield call(of.regulators_of_weights, plant=plant, weighed=[plant.energy], control_weights=[1e-7, 1e-6])


def designs_calls(_: Path) -> Calls:
    """Weights from limits and budgets, and models of dampers in laws."""
    of, frame = mr.control, five_storeys()
    wishes = {"limits": {"rms_drift": 2e-3, "rms_acceleration": "1 m/s2"}, "budget": [500.0]}
    loop = devices(rd1005())
    yield call(of.RmsLimits, rms_drift=[2e-3] * 5, rms_acceleration=1.0, rms_displacement=0.01, rms_force=1e3)
    yield call(of.RmsLimits.of, given=wishes["limits"])
    motion = {"amplitude": (1e-4, 1e-2), "velocity": (0.01, 0.2)}
    yield call(of.DesignProblem, building=frame, devices=loop, sample_time=1e-3, delay=0.0, **motion)


def laws_calls(_: Path) -> Calls:
    """Control laws and their settings."""
    of, frame = mr.control, five_storeys()
    problem = of.DesignProblem(building=frame, devices=devices(rd1005()), sample_time=1e-3)
    clipped = {"accelerations": [1.0] * 5, "control_weight": [1e-7, 1e-7], "full_force": 1e3}
    known = of.design_law("clipped_optimal", problem, of.RegulatorSettings(control_weight=1e-7))
    table = fuzzy_table()[1].ravel()
    scales = {"deformation_scale": [2e-3, 2e-3], "rate_scale": [0.05, 0.05]}
    gains = dict(known.gains)
    yield call(mr.ControlLaw, name="clipped_optimal", gains=gains)
    yield call(mr.ControlLaw, name="fuzzy", gains=scales, tables={"shares": table})
    yield call(mr.ControlLaw, name="inverse_direct", gains=gains, curve=rd1005())
    yield call(known.gain_rows, n_devices=2, n_states=10)
    yield call(of.settings_of, name="modified_clipped_optimal", given=clipped)
    yield call(of.design_law, name="modified_clipped_optimal", problem=problem, settings=clipped)
    lyapunov = of.settings_of("lyapunov", {"state_weight": np.eye(10)})
    yield call(of.design_law, name="lyapunov", problem=problem, settings=lyapunov)
    weights = {"drifts": np.eye(5), "energy": 1.0, "state_weight": np.ones(10), "control_weight": 1e-7}
    yield call(of.RegulatorSettings, **weights)


def loop_calls(_: Path) -> Calls:
    """The closed loop and its hardware."""
    of, frame, loop, motion = mr.closed_loop, five_storeys(), devices(rd1005()), sweep(0.1)
    law = mr.ControlLaw(name="passive", gains={"command": [1.0, 1.0]})
    share = mr.ControlLaw(name="decentralised_bang_bang")
    run = mr.simulate_loop(frame, loop, law, [motion], histories=True, threads=1)
    device = named(loop[0], "name", "spec", "theta", "row", "largest_command", "count")
    yield call(mr.Device, **device, differential=True, lag=190.0, sprung=frame.floors[0])
    yield call(mr.Device, **{**device, "theta": np.tile(np.asarray(loop[0].theta), (3, 1))})
    hardware = {
        **{"sample_time": 1e-3, "step": 5e-4, "delay": 1e-3, "command_rate": 100.0, "feedback": "observer"},
        **{"measured_floors": (0, 4), "noise_ratio": 50.0, "acceleration_noise": 0.01, "seed": 3},
        **{"deformation_resolution": 1e-5, "faults": (of.Fault(channel="force"),)},
    }
    yield call(mr.Hardware, **hardware)
    options = {"n_candidates": 2, "n_memory": 1, "rms_time": 1.0, "record": True, "source": "s"}
    yield call(of.UserLaw, name="x", command=_viscous, **options)
    yield call(
        mr.own_law,
        function=_own,
        memory={"v": 0.0, "last": [0.0, 0.0]},
        settings={"gain": ("A s/m", 0.1, 6.0, 100.0)},
        **{"name": "x", "title": "X", "rms_time": 1.0, "record": True},
    )
    outside = {
        "name": "x",
        "readings": ("force",),
        "replaces_readings": True,
        "timeout": 1.0,
        "start_timeout": 1.0,
    }
    yield call(of.ProcessLaw, **outside, program=("./controller",))
    yield call(of.ProcessLaw, **outside, address=("localhost", 4000))
    law_outside = of.ProcessLaw(**outside, program=("./controller",))
    yield call(law_outside.protocol, building=frame, devices=loop, hardware=mr.Hardware())
    yield call(law_outside.placeholder, devices=loop)
    values = {
        **{"building": frame, "nominal": frame, "devices": loop, "law": law},
        **{"motions": [motion]},
        **{"hardware": mr.Hardware(feedback="observer"), "histories": False, "step_factor": 1, "threads": 1},
        **{"shaping": [[0.01, 50.0]]},
        "variation": of.LoopVariation(
            buildings=(frame, frame), delay=np.zeros(2), seed=np.zeros(2, dtype=np.int64)
        ),
    }
    yield from calls_with(values, mr.simulate_loop)
    shared = {"law": share, "largest_commands": [1.0, 1.5], "hardware": mr.Hardware()}
    shared |= {name: values[name] for name in ("building", "devices", "motions", "threads")}
    yield from calls_with(shared, mr.simulate_loop)
    yield call(run.demand, run=0, device=1)
    yield call(run.over_axes, name="peak_drift")
    yield call(run.outside, run=0)


def studies_calls(place: Path) -> Calls:
    """Studies and their results."""
    found = results()
    baseline = {"viscous": {"storey": 1, "damping": 10.0}}
    given = {
        **{"building": five_storeys(), "motions": [sweep(0.1)], "hardware": mr.Hardware(), "title": "a"},
        **{"dampers": [{"storey": 1, "preset": "kwok2006"}], "references": "none", "folder": ".", "seed": 0},
        **{"laws": ["best_passive", {"law": "passive_on"}, _viscous]},
        **{"baselines": [{"label": "b", "building": baseline}], "tune": {"laws": ["lyapunov"]}},
        **{"uncertainty": {"realisations": 2, "stiffness": 0.1}, "places": {"dampers": 2}},
        **{"report": {"histories": "none"}},
        "design_level": float(sweep(0.1).peak),
    }
    yield call(mr.study_of, **given)
    study = mr.study_of(building=five_storeys(), motions=[sweep(0.1)])
    yield call(mr.study.designed, study=study)
    yield call(study.to_toml, path=place / "study.toml", replace=True)
    yield call(mr.study.compared, results=found)
    yield from calls_with({"row": 3, "motion": 0}, found.criteria, found.step_changes)
    table = {
        **{"laws": ["clipped_optimal"], "label": "tuned", "settings": {"control_weight": 1e-7}, "seed": 0},
        **{"free": {"drifts": (1.0, 2.0)}, "criteria": {"peak_drift": 1.0}, "relative_to": "passive_off"},
        **{"combine": "mean", "objectives": ["peak_drift", "peak_force"], "risk": "cvar", "tail": 0.2},
        **{"constraints": {"peak_stroke": "20 mm"}, "robust": False, "search": "differential_evolution"},
        **{"population": 8, "budget": 16, "gradient_steps": 0},
    }
    yield call(mr.study.TuneTable, **table)


ROOMS = (buildings_calls, plants_calls, gains_calls, designs_calls, laws_calls, loop_calls, studies_calls)
