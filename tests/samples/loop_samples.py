"""Loops that the tests of the closed loop share: buildings with devices, motions, and every law with its numbers."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.signal import lsim

import mrwork as mr
from mrwork.control.laws.fuzzy import fuzzy_table
from mrwork.control.laws.sliding import SlidingSettings
from mrwork.dampers.parameters import Lag
from mrwork.dampers.spec import with_other_dependences

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

LARGEST = 1.88
LAG = 190.0


def five_storeys() -> mr.Building:
    """The five storeys of UTS."""
    return mr.building("uts")


@cache
def rd1005(*, lag: Lag = "one_rate") -> tuple[mr.DamperSpec, Floats]:
    """The static model of an RD-1005-3 by its published set, behind the lag of its driver, which falls slower."""
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    spec = with_other_dependences(preset.spec, lag=lag)
    return spec, np.array([*preset.theta, *[LAG, 0.3 * LAG][: spec.n_rates]])


@cache
def hysteretic() -> tuple[mr.DamperSpec, Floats]:
    """A Bouc-Wen loop of 230 N that the command raises, behind a lag."""
    spec = mr.damper("bouc_wen").with_current_laws({"alpha": "linear", "c0": "linear"}, lag="one_rate")
    # c0 by the current, k0, x0, alpha by the current, gamma, beta, A, n, eta.
    return spec, np.array([700.0, 900.0, 800.0, 0.0, 3e4, 4e4, 1e6, 1e6, 120.0, 2.0, LAG])


@cache
def friction() -> tuple[mr.DamperSpec, Floats]:
    """A smooth friction and a dashpot, both by the command: force and rate have one sign at every instant."""
    spec = mr.damper("bingham").with_current_laws({"f_c": "linear", "c0": "linear"}, lag="one_rate")
    # f_c and c0 by the current, v_s, f0, eta.
    return spec, np.array([20.0, 300.0, 0.02, 200.0, 500.0, 0.0, LAG])


def devices(
    model: tuple[mr.DamperSpec, Floats], *, of: mr.Building | None = None, second: bool = True
) -> list[mr.Device]:
    """A differential pair across the lowest storey, and two dampers side by side across the next."""
    rows = (of or five_storeys()).storeys
    spec, theta = model
    pair = mr.Device(
        name="pair", spec=spec, theta=theta, row=rows[0], largest_command=LARGEST, differential=True
    )
    return [pair, replace(pair, name="two", row=rows[1], differential=False, count=2.0)][: 1 + second]


def design_problem(**others: object) -> mr.control.DesignProblem:
    """The design of a law for the pair alone."""
    pair = devices(rd1005(), second=False)
    return mr.control.DesignProblem(building=five_storeys(), devices=pair, sample_time=1e-3, **others)


def sweep(duration: float = 2.0, *, peak: float = 2.0, dt: float = 0.01) -> mr.GroundMotion:
    """A sinusoid that sweeps from 1 to 8 Hz, under a half sine: from rest to rest."""
    time = dt * np.arange(round(duration / dt) + 1)
    phase = 2.0 * np.pi * (1.0 + 3.5 * time / duration) * time
    return mr.GroundMotion(
        name="sweep", dt=dt, acceleration=peak * np.sin(np.pi * time / duration) * np.sin(phase)
    )


def still(duration: float = 1.0) -> mr.GroundMotion:
    """No motion."""
    return mr.GroundMotion(name="still", dt=duration, acceleration=np.zeros(2))


def pushed(acceleration: float, duration: float) -> mr.GroundMotion:
    """A constant acceleration from the first instant."""
    return mr.GroundMotion(name="pushed", dt=duration, acceleration=np.full(2, acceleration))


def at_samples(found: mr.Responses) -> mr.closed_loop.History:
    """The history of the first run at its control samples, without its end, where no command is computed."""
    numbers = {name: each[:-1] for name, each in found.histories[0].numbers.items()}
    return mr.closed_loop.History(time=found.histories[0].time[:-1], numbers=numbers)


def nothing(building: mr.Building) -> tuple[list[mr.Device], mr.ControlLaw]:
    """An actuator that is told to give no force."""
    spec, theta = friction()
    device = mr.Device(name="none", spec=spec, theta=theta, row=building.storeys[0], largest_command=1.0)
    n = building.n_coordinates
    return [device], mr.ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * n))})


def linear_states(
    building: mr.Building, motion: mr.GroundMotion, time: Floats, dashpot: float = 0.0
) -> Floats:
    """State of a linear building by the exponential of its matrix under straight pieces, shape (n_time, 2n)."""
    n, (A, _, E) = building.n_coordinates, building.state_matrices()
    rows = building.storeys[:2]
    A[n:, n:] -= dashpot * np.linalg.solve(building.mass, rows.T @ rows)
    B = np.vstack([np.zeros((n, n)), np.linalg.solve(building.mass, building.floors.T)])
    forces = motion.forces if np.size(motion.forces) else np.zeros((n, motion.n_time))
    loads = np.column_stack([np.interp(time, motion.time, each) for each in (motion.acceleration, *forces)])
    system = A, np.column_stack([E, B]), np.eye(2 * n), np.zeros((2 * n, n + 1))
    return np.asarray(lsim(system, loads, time)[2])


def under_a_sine(spec: mr.DamperSpec, theta: Sequence[float]) -> mr.Responses:
    """One passive damper in the five storeys, with its history."""
    building = five_storeys()
    device = mr.Device(name="one", spec=spec, theta=theta, row=building.storeys[0], largest_command=1.0)
    ground = 3.0 * np.sin(15.0 * np.arange(0.0, 2.0, 0.01))
    motion = mr.GroundMotion(name="sine", dt=0.01, acceleration=ground)
    law = mr.ControlLaw(name="passive", gains={"command": [[0.0]]})
    return mr.simulate_loop(building, [device], law, [motion], histories=True)


def run_of(
    loop: list[mr.Device],
    law: mr.ControlLaw | mr.closed_loop.UserLaw,
    hardware: mr.Hardware | None = None,
    motion: mr.GroundMotion | None = None,
    building: mr.Building | None = None,
) -> mr.closed_loop.History:
    """What a run that has finished looks like at its control samples, in the five storeys unless others are given."""
    of = building or five_storeys(), loop, law, [motion or sweep(1.0)], hardware
    response = mr.simulate_loop(*of, histories=True)
    assert response.outcome[0] == mr.dampers.Outcome.FINISHED
    return at_samples(response)


def named_in(gains: dict[str, Floats], *names: str) -> dict[str, Floats]:
    return {name: gains[name] for name in names}


def law_with_gains(name: str, plant: mr.control.Plant, *, strength: float = 1.0) -> mr.ControlLaw:
    """A law of the registry with reasonable numbers for a building with these devices.

    What makes the law act more is multiplied by `strength`; what scales a signal is not.
    """
    each = np.ones(plant.n_devices)
    K = strength * mr.control.regulator_of_state(plant, plant.energy, 1e-6).gain
    weight = strength * mr.control.lyapunov_function(plant).vectors
    surface = mr.control.optimal_surface(plant)
    sliding = SlidingSettings(peak_acceleration=2.0, largest_force=1500.0).gains(surface)
    slides = {name: strength * values for name, values in sliding.items()}
    slides |= {"surface": -strength * surface.S, "boundary": sliding["boundary"]}
    scale = {"deformation_scale": 2e-3 * each, "rate_scale": 0.05 * each}
    weighed = ("lyapunov", "lyapunov_direct", "lyapunov_parabola", "lyapunov_direct_bang_bang")
    inverses = ("inverse_direct", "inverse_parabola", "inverse_network")
    gains: dict[str, dict[str, Floats]] = {
        **{key: {"weight": weight} for key in weighed},
        **{key: {"gain": K} for key in ("clipped_optimal", *inverses, "active")},
        **{
            key: {"gain": K, "full_force": 1000.0 * each}
            for key in ("modified_clipped_optimal", "proportional_clipped_optimal")
        },
        "passive": {"command": strength * each},
        "decentralised_bang_bang": {},
        "maximum_energy_dissipation": {},
        "modulated_homogeneous_friction": {"slope": strength * 2e5 * each},
        "sliding_mode": named_in(slides, "gain", "surface", "boundary", "switching"),
        "adaptive_sliding_mode": named_in(
            slides, "gain", "surface", "boundary", "adaptation", "floor", "ceiling"
        ),
        "super_twisting": {"surface": strength * surface.S}
        | named_in(slides, "drift", "push", "root_gain", "integral_gain"),
        "fuzzy": scale,
        "proportional_direct": {"weight": weight, "slope": 5.0 * each},
        "signal_network": {"gain": K, "network": strength * _signal_network(plant.n_devices)},
        "acceleration_driven": {},
        "mixed_skyhook": {"crossover": 30.0 * each},
        "skyhook_groundhook": {"share": 0.7 * each},
        "predictive_rollout": {
            "base": 0.4 * strength * each,
            "tails": strength * np.outer(each, [0.16, 0.8]),
            "levels": strength * np.outer(each, [0.0, 0.15, 0.4, 0.8, LARGEST]),
            "drift_weight": np.array([2e-3**-2]),
            "acceleration_weight": np.array([3.0**-2]),
            "peak_weight": np.array([1.0]),
            "energy_weight": np.array([0.05]),
            "horizon": np.array([0.06]),
            "force_correction": np.array([0.3]),
            "residual_weight": np.array([0.0]),
        },
    }
    tables: dict[str, dict[str, Floats]] = {
        "fuzzy": {"shares": strength * _shares()},
        "inverse_network": _network(strength),
        "predictive_rollout": {
            # A decision of two samples of 4 ms, in eight steps.
            "timing": np.array([8e-3, 1e-3, 0.0, 0.2, 5.0]),
            "forecast": np.array([4.0, 0.998, 100.0]),
            "correction": np.array([1.0, 50.0]),
            "shears": np.array([0.0, 0.0, 1.0, 1.0]),
        },
    }
    curve = rd1005() if mr.control.control_law(name).needs_curve else None
    model = believed(plant) if mr.control.control_law(name).needs_model else None
    return mr.ControlLaw(name=name, gains=gains[name], tables=tables.get(name, {}), curve=curve, model=model)


def believed(plant: mr.control.Plant) -> mr.control.LoopModel:
    """The loop that a law believes in: stiffer than it is, with weaker dampers."""
    spec, theta = rd1005()
    of = plant.building
    weaker = np.array(theta)
    weaker[list(spec.names).index("c.0")] *= 0.85
    rows = plant.attachment
    pair = mr.Device(
        name="pair", spec=spec, theta=weaker, row=rows[0], largest_command=LARGEST, differential=True
    )
    two = [replace(pair, name="two", row=row, differential=False, count=2.0) for row in rows[1:]]
    return mr.control.LoopModel(building=replace(of, stiffness=1.05 * of.stiffness), devices=[pair, *two])


@cache
def _shares() -> Floats:
    return fuzzy_table()[1].ravel()


def _network(strength: float) -> dict[str, Floats]:
    """A network of three units that has learned nothing, in the scale of the devices here."""
    rng = np.random.default_rng(6)
    reach = np.tile([2e-3, 0.05, 1000.0], 2)
    layer = np.hstack([rng.normal(size=(3, 1)), rng.normal(size=(3, 6)) / reach, rng.normal(size=(3, 1))])
    layer[:, -1] *= strength
    return {"layer": layer, "output": np.array([0.5 * strength]), "reach": reach}


def _signal_network(n_devices: int) -> Floats:
    """Networks that have learned nothing, another for each device."""
    networks = np.random.default_rng(7).normal(size=(n_devices, 25))
    networks[:, :-1].reshape(n_devices, 4, 6)[:, :, 1:-1] /= [2e-3, 0.05, 1000.0, 1000.0]
    return networks


def plant_with(loop: list[mr.Device], of: mr.Building | None = None) -> mr.control.Plant:
    """The linear system on which laws for these devices are designed."""
    return mr.control.plant_of(of or five_storeys(), [device.row for device in loop])
