"""Faults of studies that are told when they are read, for `tools.faults.planted`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from mrwork.base.keys import toml_value
from mrwork.study import read_study
from tools.faults.planted import Rng, said_by

Table = dict[str, Any]
NO_STOREYS: Final = dict.fromkeys(("n_storeys", "masses", "stiffnesses", "height"))


def frame(rng: Rng, n: int) -> Table:
    """A study of a bare frame of a laboratory or of a town."""
    is_real = rng.random() < 0.7
    mass = rng.uniform(2e4, 8e5) if is_real else rng.uniform(20.0, 900.0)
    period = n * rng.uniform(0.06, 0.16)
    stiffness = mass * (math.pi / period / math.sin(math.pi / (4.0 * n + 2.0))) ** 2
    building: Table = {
        "n_storeys": n,
        "masses": [mass],
        "stiffnesses": [stiffness],
        "height": 3.4 if is_real else 0.6,
    }
    building["modal_damping"] = {"ratios": [float(rng.choice([0.005, 0.02, 0.05]))]}
    return {"building": building, "motion": {"synthetic": "kanai_tajimi", "duration": 4.0, "pga": "0.3 g"}}


def honest(rng: Rng, folder: Path) -> str:
    """A frame by its storeys or by matrices, with what engineers build in, and motions as they scale them."""
    study = frame(rng, int(rng.integers(1, 9)))
    n, (mass,), (k,) = (study["building"][name] for name in ("n_storeys", "masses", "stiffnesses"))
    peak = float(rng.choice([0.1, 0.2, 0.35, 0.6]))
    scales = ({"pga": f"{peak} g"}, {"pga": 9.81 * peak}, {"pga": None, "sa": f"{peak} g", "sa_period": 0.8})
    built = (
        {"viscous": {"storey": 1, "damping": rng.uniform(0.05, 1.0) * 2.0 * math.sqrt(mass * k)}},
        {"friction": {"storey": 1, "slip_load": 0.5 * n * mass, "stiffness": 2.0 * k}},
        {"tuned_mass": {"floor": n, "mass_ratio": rng.uniform(0.005, 0.05)}},
        {"isolation": {"mass": mass, "period": rng.uniform(1.5, 4.0), "ratio": 0.15}},
        {"brace": {"storey": 1, "stiffness": 5.0 * k, "mass": 1e-3 * mass}},
        {"storeys_that_yield": {"yield_drift_ratio": rng.uniform(0.003, 0.015)}},
        {"drift_limit": float(rng.choice([0.004, 0.01, 0.02]))},
        _matrices(n, mass, k, rng),
        {},
    )
    baseline = {"label": "other", "building": {"modal_damping": {"ratios": [0.03]}, "viscous": []}}
    study |= {"baseline": [baseline]} if rng.random() < 0.3 else {}
    patch = {"building": built[int(rng.integers(len(built)))], "motion": scales[int(rng.integers(3))]}
    return _said(_patched(study, patch), folder)


def _matrices(n: int, mass: float, k: float, rng: Rng) -> Table:
    """Matrices of a chain, of two towers, of a frame on a soil spring, of one that bends, and of distributed mass."""
    form, rows = rng.choice(["chain", "towers", "soil", "bends", "distributed"]), np.eye(n) - np.eye(n, k=-1)
    stiffness = k * rows.T @ rows
    if form == "towers":
        rows, stiffness = np.kron(np.eye(2), rows), np.kron(np.diag([1.0, 1.3]), stiffness)
    elif form == "soil":
        stiffness[0, 0] += 4.0 * k
    elif form == "bends":
        floors = np.arange(1.0, n + 1.0)
        low, high = np.minimum.outer(floors, floors), np.maximum.outer(floors, floors)
        stiffness = k * np.linalg.inv(low**2 * (3.0 * high - low) / (6.0 * n) + low)
    shares = np.eye(len(rows)) - (rows.T @ rows / 6.0 if form == "distributed" else 0.0)
    return NO_STOREYS | _lists(mass * shares, (stiffness + stiffness.T) / 2.0, storeys=rows)


def _lists(mass: Any, stiffness: Any, storeys: Any = None) -> Table:
    given = {"mass": mass, "stiffness": stiffness, "storeys": storeys}
    return {name: None if each is None else np.asarray(each).tolist() for name, each in given.items()}


def _rotations(rng: Rng) -> Table:
    """Two floors of a beam with rotations, without their influence."""
    l, s = rng.uniform(2.5, 4.0), float(rng.choice([-1.0, 1.0]))  # noqa: E741 # the length in textbooks
    beam = [[24, 0, -12, 6 * s * l], [0, 8 * l * l, -6 * s * l, 2 * l * l], [-12, -6 * s * l, 12, -6 * s * l]]
    k = 1e8 / l**3 * np.array([*beam, [6 * s * l, 2 * l * l, -6 * s * l, 4 * l * l]])
    inertia, order = float(rng.choice([0.01, 1.0, 1e3, 2e4])), [0, *rng.permutation([1, 2]), 3]
    at = np.ix_(order, order)
    return {"building": NO_STOREYS | _lists(np.diag([1e5, inertia, 1e5, inertia])[at], k[at])}


def _drifts(rng: Rng) -> Table:
    """A chain in the coordinates of its drifts, as if they were those of its floors."""
    floors = np.tril(np.ones((n := int(rng.integers(2, 7)), n)))
    return {"building": NO_STOREYS | _lists(5e4 * floors.T @ floors, 6e7 * np.eye(n))}


def _buildings(*given: Table) -> tuple[Table, ...]:
    return tuple({"building": each} for each in given)


TOWN: Final = {"masses": [5e4], "stiffnesses": [6e7]}
UNDAMPED: Final = {"modal_damping": None}
TOWERS: Final = _lists(5e4 * np.eye(4), np.kron(np.eye(2), [[8e7, -4e7], [-4e7, 4e7]]))
LIGHT: Final = UNDAMPED | {"stiffnesses": [6e8, 5e7, 5e7], "rayleigh": {"ratios": [0.02, 0.02]}}
_PATCHES: Final[Mapping[str, tuple[Table | Callable[[Rng], Table], ...]]] = {
    "per cent or ratio": (
        *_buildings({"modal_damping": {"ratios": [0.5]}}, {"modal_damping": {"ratios": [1.0]}}, {"drift_limit": 0.5}),
        *_buildings({"storeys_that_yield": {"yield_drift_ratio": 0.4}}),
        *_buildings({"tuned_mass": {"floor": 1, "mass_ratio": 2.0}}),
        *_buildings({"isolation": {"mass": 5e4, "period": 2.5, "ratio": 15.0}}, {"drift_limit": "0.01 %"}),
        *({"report": {"limit": {"peak_drift_ratio": each}}} for each in (1.0, 0.5, 2.0)),
    ),
    "g or m/s2": tuple({"motion": {"pga": each}} for each in (300.0, 0.3, 20_000.0, 0.15, [0.1, 0.2, 0.3])),
    "mm or m": (
        *_buildings({"storeys_that_yield": {"yield_drift": 17.5}}, {"storeys_that_yield": {"yield_drift": 9.0}}),
        *_buildings({"height": 3200.0}, {"height": 0.0032}),
        *_buildings({"yielding": {"storey": 1, "yield_force": 1e3, "yield_displacement": 4.0}}),
        *({"report": {"limit": each}} for each in ({"peak_drift": 20.0}, {"peak_stroke": 30.0})),
    ),
    "N or kN": _buildings(
        {"masses": [0.03, 0.05, 0.02]}, {"masses": [3e9, 5e9, 4e9]}, {"stiffnesses": [1e15]},
        {"masses": [50.0], "stiffnesses": [6e4], "height": 3.0},
        TOWN | {"storeys_that_yield": {"yield_shear": 600.0}},
        TOWN | {"storeys_that_yield": {"yield_shear": 6e8}},
        TOWN | {"friction": {"storey": 1, "slip_load": 90.0, "stiffness": 2e8}},
        TOWN | {"viscous": {"storey": 1, "damping": 90.0}},
    ),
    "ms or s": (
        *({"hardware": {name: each}} for name, each in (("sample_time", 1.0), ("sample_time", 5.0), ("delay", 2.0))),
        {"motion": {"pga": None, "sa": "0.3 g", "sa_period": 80.0}}, {"motion": {"dt": 10.0}},
    ),
    "influence": (_rotations, _drifts),
    "light coordinate": _buildings(*(LIGHT | {"masses": [each, 1e5, 1e5]} for each in (0.01, 0.05, 0.2))),
    "equal towers": _buildings(NO_STOREYS | TOWERS | {"modal_damping": {"ratios": [0.02, 0.05, 0.02, 0.02]}}),
    "falls": _buildings({"loads": [3e10, 2e10, 1e10]}, {"p_delta": True, "masses": [5e4], "stiffnesses": [1e5]}),
    "damping": _buildings(*(UNDAMPED | {"storey_damping": [each]} for each in (1e9, 1e10))),
    "key without effect": tuple(
        {"baseline": [{"label": "same", "building": each}]}
        for each in ({"source": "another"}, {"viscous": []}, {"p_delta": False})
    ),
}  # fmt: skip


def _patched(table: Table, patch: Table) -> Table:
    """The table with the values of a patch, of which `None` takes a key away."""
    inner = {
        name: _patched(table.get(name, {}), each) if isinstance(each, dict) else each
        for name, each in patch.items()
    }
    return {name: each for name, each in (table | inner).items() if each is not None}


def _said(study: Table, folder: Path) -> str:
    """What is said of a study when it is read: a refusal or warnings."""
    path = folder / "study.toml"
    lines = (f"{name} = {toml_value([each] if name == 'motion' else each)}\n" for name, each in study.items())
    path.write_text("".join(lines))
    said = said_by(read_study, path)
    return "" if re.search("no key|not TOML", said) else said


def _fault(patch: Table | Callable[[Rng], Table], rng: Rng, folder: Path) -> str:
    return _said(_patched(frame(rng, 3), patch(rng) if callable(patch) else patch), folder)


FAULTS: Final = {kind: tuple(partial(_fault, each) for each in patches) for kind, patches in _PATCHES.items()}
