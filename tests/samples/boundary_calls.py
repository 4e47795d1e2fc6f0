"""Calls that the compiled module accepts, for sweeps of its boundary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mrwork import _rust

REFUSALS = (ValueError, TypeError, LookupError, OverflowError, MemoryError)
N_TIME = 8
N, DEVICES, STATES = 3, 2, 6
MODEL = "static_hysteretic"
NOMINAL = np.array(
    [p["nominal"] for s in _rust.damper_specs() if s["name"] == MODEL for p in s["parameters"]]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """A function of the module with arguments that it accepts; `free` are axes whose length is free."""

    function: Callable[..., Any]
    arguments: dict[str, Any]
    free: dict[str, tuple[int, ...]]


def building_arguments() -> dict[str, Any]:
    chain = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    return {
        "mass": np.eye(N),
        "damping": chain,
        "stiffness": 100.0 * chain,
        "influence": np.ones(N),
        "floors": np.eye(N)[: N - 1],
        "storeys": np.eye(N) - np.eye(N, k=-1),
        "devices": np.eye(N)[:DEVICES],
        "elements": np.eye(N)[1:],
        "element_parameters": np.array([[5.0, 1.0, 0.0, 2.0, 100.0, 4.0], [0.0, 0.0, 3.0, 0.0, 1.0, 1.0]]),
    }


def respond_arguments() -> dict[str, Any]:
    # A regulator whose command inverts the curve, an observer, two draws, three candidates, two motions.
    rng = np.random.default_rng(1)
    observer = (
        [0, 1],
        [1],
        0.9 * np.eye(STATES),
        1e-3 * np.ones((STATES, DEVICES)),
        1e-3 * np.ones((STATES, 3)),
        np.ones((3, STATES)),
        np.ones((3, DEVICES)),
    )
    return {
        "building": _rust.Building(**building_arguments()),
        "model": MODEL,
        "laws": (None, False),
        "theta": np.tile(NOMINAL, (2, DEVICES, 1)),
        "places": [(1.0, False), (2.0, True)],
        "ranges": [[0.0, 2.0], [0.0, 1.0]],
        "law": "inverse_direct",
        "gains": rng.normal(size=(3, DEVICES * STATES)),
        "tables": [],
        "curve": ((["linear"] + ["constant"] * (len(NOMINAL) - 1), False), np.insert(NOMINAL, 1, 10.0)),
        "motions": [(0.01, np.ones(4)), (0.01, np.ones(3))],
        "runs": np.array([[0, 0, 0], [1, 1, 1], [2, 0, 1], [2, 1, 0]], dtype=np.uint32),
        "streams": np.arange(4, dtype=np.uint64),
        "sample_time": 1e-3,
        "steps": 1,
        "delay_steps": 0,
        "command_rate": np.inf,
        "sensors": [[0.1, 0.0], [0.0, 1e-3], [0.0, 0.0]],
        "faults": [("force", 0, 1, 3, None)],
        "observer": observer,
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
        "respond": Call(
            function=_rust.respond,
            arguments=respond_arguments(),
            free={"theta": (0,), "gains": (0,), "motions[0][1]": every, "motions[1][1]": every},
        ),
    }


CALLS = calls()
