"""Calls that the compiled module accepts, for sweeps of its boundary."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from mrwork import _rust

REFUSALS = (ValueError, TypeError, AttributeError, LookupError, OverflowError, MemoryError)
Place = tuple[Any, ...]
N_TIME = 8
N, DEVICES, STATES = 3, 2, 6
MODEL = "static_hysteretic"
NOMINAL = np.array(
    [p["nominal"] for s in _rust.damper_specs() if s["name"] == MODEL for p in s["parameters"]]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """A function of the module with arguments that it accepts; `free` are axes of free length of its arrays."""

    function: Callable[..., Any]
    arguments: dict[str, Any]
    free: dict[str, tuple[int, ...]]


def leaves(value: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Every part of an argument, with its place: the argument itself, its entries, and theirs."""
    yield place, value
    if isinstance(value, (list, tuple)):
        for index, entry in enumerate(value):
            yield from leaves(entry, (*place, index))
    if isinstance(value, SimpleNamespace):
        for name, entry in vars(value).items():
            yield from leaves(entry, (*place, name))


def with_part(value: Any, place: Place, part: Any) -> Any:
    if not place:
        return part
    if isinstance(value, SimpleNamespace):
        own = vars(value)
        return SimpleNamespace(**{**own, place[0]: with_part(own[place[0]], place[1:], part)})
    entries = list(value)
    entries[place[0]] = with_part(entries[place[0]], place[1:], part)
    return type(value)(entries)


def unaligned(array: np.ndarray) -> np.ndarray:
    room = np.zeros(array.nbytes + 1, dtype=np.uint8)
    other = np.ndarray(array.shape, array.dtype, buffer=room.data, offset=1)
    other[...] = array
    return other


def building_arguments() -> dict[str, Any]:
    chain = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    return {
        "mass": np.eye(N),
        "damping": chain,
        "stiffness": 100.0 * chain,
        "influence": np.ones(N),
        "floors": np.eye(N)[: N - 1],
        "storeys": np.eye(N) - np.eye(N, k=-1),
        "unit_drifts": np.ascontiguousarray(np.tri(N).T),
        "heights": np.full(N, 3.0),
        "storey_springs": np.full(N, 100.0),
        "devices": np.eye(N)[:DEVICES],
        "elements": [
            SimpleNamespace(
                row=np.eye(N)[1],
                stiffness=5.0,
                damping=1.0,
                head_loss=0.0,
                yield_force=2.0,
                yield_displacement=0.01,
                sharpness=4.0,
                in_stiffness=True,
            ),
            SimpleNamespace(
                row=np.eye(N)[2],
                stiffness=0.0,
                damping=0.0,
                head_loss=3.0,
                yield_force=0.0,
                yield_displacement=1.0,
                sharpness=1.0,
                in_stiffness=False,
            ),
        ],
    }


def dampers_arguments() -> dict[str, Any]:
    return {
        "model": MODEL,
        "theta": np.tile(NOMINAL, (2, DEVICES, 1)),
        "counts": [1.0, 2.0],
        "differential": [False, True],
        "ranges": [[0.0, 2.0], [0.0, 1.0]],
        "laws": None,
        "lagged": False,
    }


def curve_arguments() -> dict[str, Any]:
    return {
        "laws": ["linear"] + ["constant"] * (len(NOMINAL) - 1),
        "theta": np.insert(NOMINAL, 1, 10.0),
        "lagged": False,
    }


def controller_arguments() -> dict[str, Any]:
    # A regulator whose command inverts the curve.
    return {
        "law": "inverse_direct",
        "gains": np.random.default_rng(1).normal(size=(3, DEVICES * STATES)),
        "tables": [],
        "curve": _rust.ForceCurve(**curve_arguments()),
    }


def observer_arguments() -> dict[str, Any]:
    return {
        "accelerations": [0, 1],
        "deformations": [1],
        "transition": 0.9 * np.eye(STATES),
        "input": 1e-3 * np.ones((STATES, DEVICES)),
        "gain": 1e-3 * np.ones((STATES, 3)),
        "output": np.ones((3, STATES)),
        "direct": np.ones((3, DEVICES)),
    }


def hardware(**changes: Any) -> SimpleNamespace:
    settings = {
        "sample_time": 1e-3,
        "steps": 1,
        "delay_steps": 0,
        "command_rate": np.inf,
        "ground_preview": 0.0,
        "acceleration_noise": 0.1,
        "acceleration_resolution": 0.0,
        "deformation_noise": 0.0,
        "deformation_resolution": 1e-3,
        "force_noise": 0.0,
        "force_resolution": 0.0,
        "ground_acceleration_noise": 0.0,
        "ground_acceleration_resolution": 0.0,
        "sampled_faults": [fault()],
    }
    return SimpleNamespace(**{**settings, **changes})


def fault(**changes: Any) -> SimpleNamespace:
    return SimpleNamespace(**{"channel": "force", "index": 0, "start": 1, "end": 3, "value": None, **changes})


def respond_arguments() -> dict[str, Any]:
    # An observer, two draws, three candidates, two motions.
    return {
        "building": _rust.Building(**building_arguments()),
        "dampers": _rust.Dampers(**dampers_arguments()),
        "controller": _rust.Controller(**controller_arguments()),
        "hardware": hardware(),
        "motions": [(0.01, np.ones(4)), (0.01, np.ones(3))],
        "runs": np.array(
            [[0, 0, 0, 0, 0], [1, 1, 1, 0, 0], [2, 0, 1, 0, 0], [2, 1, 0, 0, 0]], dtype=np.uint32
        ),
        "streams": np.arange(4, dtype=np.uint64),
        "observer": _rust.Observer(**observer_arguments()),
        "histories": True,
    }


def riccati_arguments() -> dict[str, Any]:
    def for_each_row(matrix: np.ndarray) -> np.ndarray:
        return np.tile(matrix, (3, 1, 1))

    states, controls = 4, 2
    return {
        "time": "continuous",
        "state": for_each_row(np.eye(states, k=1) - np.eye(states)),
        "control": for_each_row(np.eye(states)[:, :controls].copy()),
        "state_weight": for_each_row(np.eye(states)),
        "control_weight": for_each_row(np.eye(controls)),
        "cross_weight": for_each_row(np.zeros((states, controls))),
        "scaling": for_each_row(np.eye(states)),
    }


def calls() -> dict[str, Call]:
    displacement = np.sin(np.arange(N_TIME))
    history = _rust.LoadingHistory(0.01, displacement)
    theta = np.tile(NOMINAL, (3, 1))
    batch = {"model": MODEL, "theta": theta, "loading": history}
    point = {"model": MODEL, "theta": NOMINAL, "state": np.zeros(0), "displacement": 0.0, "velocity": 0.0}
    every = (0, 1)
    return {
        "LoadingHistory": Call(
            function=_rust.LoadingHistory,
            arguments={
                "dt": 0.01,
                "displacement": displacement,
                "velocity": displacement.copy(),
                "command": displacement.copy(),
            },
            free={},
        ),
        "Building": Call(
            function=_rust.Building,
            arguments=building_arguments(),
            free={"floors": (0,), "storeys": (0,), "devices": (0,)},
        ),
        "misfits": Call(
            function=_rust.misfits,
            arguments={**batch, "force": np.zeros(N_TIME), "limits": np.full(3, np.inf)},
            free={},
        ),
        "force_histories": Call(function=_rust.force_histories, arguments=batch, free={"theta": (0,)}),
        "sensitivities": Call(function=_rust.sensitivities, arguments=batch, free={"theta": (0,)}),
        "stiffness_shares": Call(function=_rust.stiffness_shares, arguments=batch, free={"theta": (0,)}),
        "rate": Call(function=_rust.rate, arguments=point, free={}),
        "force": Call(function=_rust.force, arguments=point, free={}),
        "flops_per_step": Call(
            function=_rust.flops_per_step, arguments={"model": MODEL, "theta": NOMINAL}, free={}
        ),
        "riccati_equations": Call(function=_rust.riccati_equations, arguments=riccati_arguments(), free={}),
        # Runs name rows of theta and gains and a motion, so more of these is no error.
        "Dampers": Call(function=_rust.Dampers, arguments=dampers_arguments(), free={"theta": (0,)}),
        "ForceCurve": Call(function=_rust.ForceCurve, arguments=curve_arguments(), free={}),
        # The loop has the numbers of devices and states, which the gains must fit.
        "Controller": Call(
            function=_rust.Controller, arguments=controller_arguments(), free={"gains": (0, 1)}
        ),
        "Observer": Call(function=_rust.Observer, arguments=observer_arguments(), free={}),
        "respond": Call(
            function=_rust.respond,
            arguments=respond_arguments(),
            free={"motions": every},
        ),
    }


CALLS = calls()
