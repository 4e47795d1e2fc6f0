"""Sweep of studies with a planted fault, and of honest ones: `python -m tools.faults.planted_studies [NUMBER] [SEED]`.

Printed are the share of each kind of fault that is told when a study is read, and honest studies that are asked about.
"""

from __future__ import annotations

import math
import re
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from mrwork.base.keys import toml_value
from mrwork.errors import MrworkError
from mrwork.study import read_study

Table = dict[str, Any]
Patch = Table | Callable[[np.random.Generator], Table]


def frame(rng: np.random.Generator, n: int | None = None) -> Table:
    """A study of a bare frame of a laboratory or of a town."""
    is_real, n = rng.random() < 0.7, n or int(rng.integers(1, 9))
    mass = rng.uniform(2e4, 8e5) if is_real else rng.uniform(20.0, 900.0)
    period = n * rng.uniform(0.06, 0.16)
    stiffness = mass * (math.pi / period / math.sin(math.pi / (4.0 * n + 2.0))) ** 2
    building = {
        "n_storeys": n,
        "masses": [mass],
        "stiffnesses": [stiffness],
        "height": 3.4 if is_real else 0.6,
    }
    motion = {"synthetic": "kanai_tajimi", "duration": 4.0, "pga": "0.3 g"}
    return {
        "building": building | {"modal_damping": {"ratios": [float(rng.choice([0.005, 0.02, 0.05]))]}},
        "motion": motion,
    }


def honest(rng: np.random.Generator) -> Table:
    """A frame by its storeys or by matrices, with what engineers build in, and motions as they scale them."""
    study = frame(rng)
    building = study["building"]
    n, (mass,), (k,) = (building[name] for name in ("n_storeys", "masses", "stiffnesses"))
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
        matrices(n, mass, k, rng),
        {},
    )
    baseline = {"label": "other", "building": {"modal_damping": {"ratios": [0.03]}, "viscous": []}}
    study |= {"baseline": [baseline]} if rng.random() < 0.3 else {}
    patch = {"building": built[int(rng.integers(len(built)))], "motion": scales[int(rng.integers(3))]}
    return patched(study, patch)


def matrices(n: int, mass: float, k: float, rng: np.random.Generator) -> Table:
    """Matrices of a chain, of two towers, of a frame on a soil spring, and of a condensed frame that bends."""
    form, rows = rng.choice(["chain", "towers", "soil", "bends"]), np.eye(n) - np.eye(n, k=-1)
    masses, stiffness = [mass] * n, k * rows.T @ rows
    if form == "towers":
        masses, rows, stiffness = (
            masses * 2,
            np.kron(np.eye(2), rows),
            np.kron(np.diag([1.0, 1.3]), stiffness),
        )
    elif form == "soil":
        stiffness[0, 0] += 4.0 * k
    elif form == "bends":
        low, high = (end(*np.meshgrid(*2 * [np.arange(1.0, n + 1.0)])) for end in (np.minimum, np.maximum))
        stiffness = k * np.linalg.inv(low**2 * (3.0 * high - low) / (6.0 * n) + low)
    other = dict.fromkeys(("n_storeys", "masses", "stiffnesses", "height"))
    symmetric = (stiffness + stiffness.T) / 2.0
    return other | {
        "mass": np.diag(masses).tolist(),
        "stiffness": symmetric.tolist(),
        "storeys": rows.tolist(),
    }


def rotations(rng: np.random.Generator) -> Table:
    """Two floors of a beam with rotations, without their influence."""
    l, s = rng.uniform(2.5, 4.0), float(rng.choice([-1.0, 1.0]))  # noqa: E741 # the length in textbooks
    beam = [[24, 0, -12, 6 * s * l], [0, 8 * l * l, -6 * s * l, 2 * l * l], [-12, -6 * s * l, 12, -6 * s * l]]
    k = 1e8 / l**3 * np.array([*beam, [6 * s * l, 2 * l * l, -6 * s * l, 4 * l * l]])
    inertia, order = (
        float(rng.choice([0.01, 1.0, 1e3, 2e4])),
        [[0, 1, 2, 3], [0, 2, 1, 3]][int(rng.integers(2))],
    )
    mass = np.diag([1e5, inertia, 1e5, inertia])
    other = matrices(2, 1.0, 1.0, rng) | {"storeys": None}
    return {
        "building": other
        | {name: a[np.ix_(order, order)].tolist() for name, a in (("mass", mass), ("stiffness", k))}
    }


def of_building(*given: Table) -> tuple[Patch, ...]:
    """Faults that give keys of the building."""
    return tuple({"building": each} for each in given)


TOWN: Final = {"masses": [5e4], "stiffnesses": [6e7]}
UNDAMPED: Final = {"modal_damping": None}
TOWERS: Final = {
    "mass": (5e4 * np.eye(4)).tolist(),
    "stiffness": np.kron(np.eye(2), [[8e7, -4e7], [-4e7, 4e7]]).tolist(),
}
NO_STOREYS: Final = dict.fromkeys(("n_storeys", "masses", "stiffnesses", "height"))
LIGHT: Final = UNDAMPED | {
    "n_storeys": 3,
    "stiffnesses": [6e8, 5e7, 5e7],
    "rayleigh": {"ratios": [0.02, 0.02]},
}
FAULTS: Final[Mapping[str, Sequence[Patch]]] = {
    "per cent or ratio": (
        *of_building({"modal_damping": {"ratios": [0.5]}}, {"modal_damping": {"ratios": [1.0]}}, {"drift_limit": 0.5}),
        *of_building({"storeys_that_yield": {"yield_drift_ratio": 0.4}}),
        *of_building({"tuned_mass": {"floor": 1, "mass_ratio": 2.0}}),
        *of_building({"isolation": {"mass": 5e4, "period": 2.5, "ratio": 15.0}}, {"drift_limit": "0.01 %"}),
        *({"report": {"limit": {"peak_drift_ratio": each}}} for each in (1.0, 0.5, 2.0)),
    ),
    "g or m/s2": tuple({"motion": {"pga": each}} for each in (300.0, 0.3, 20_000.0, 0.15, [0.1, 0.2, 0.3])),
    "mm or m": (
        *of_building({"storeys_that_yield": {"yield_drift": 17.5}}, {"storeys_that_yield": {"yield_drift": 9.0}}),
        *of_building({"height": 3200.0}, {"height": 0.0032}),
        *of_building({"yielding": {"storey": 1, "yield_force": 1e3, "yield_displacement": 4.0}}),
        *({"report": {"limit": each}} for each in ({"peak_drift": 20.0}, {"peak_stroke": 30.0})),
    ),
    "N or kN": (
        *of_building({"masses": [0.03, 0.05, 0.02]}, {"masses": [3e9, 5e9, 4e9]}, {"stiffnesses": [1e15]}),
        *of_building({"masses": [50.0], "stiffnesses": [6e4], "height": 3.0}),
        *of_building(TOWN | {"storeys_that_yield": {"yield_shear": 600.0}}),
        *of_building(TOWN | {"storeys_that_yield": {"yield_shear": 6e8}}),
        *of_building(TOWN | {"friction": {"storey": 1, "slip_load": 90.0, "stiffness": 2e8}}),
        *of_building(TOWN | {"viscous": {"storey": 1, "damping": 90.0}}),
    ),
    "ms or s": (
        *({"hardware": {name: each}} for name, each in (("sample_time", 1.0), ("sample_time", 5.0), ("delay", 2.0))),
        {"motion": {"pga": None, "sa": "0.3 g", "sa_period": 80.0}}, {"motion": {"dt": 10.0}},
    ),
    "influence": (rotations,),
    "light coordinate": of_building(*(LIGHT | {"masses": [each, 1e5, 1e5]} for each in (0.01, 0.05, 0.2))),
    "equal towers": of_building(NO_STOREYS | TOWERS | {"modal_damping": {"ratios": [0.02, 0.05, 0.02, 0.02]}}),
    "falls": of_building({"loads": [3e10, 2e10, 1e10]}, {"p_delta": True, "masses": [5e4], "stiffnesses": [1e5]}),
    "damping": of_building(*(UNDAMPED | {"storey_damping": [each]} for each in (1e9, 1e10))),
    "key without effect": tuple(
        {"baseline": [{"label": "same", "building": each}]}
        for each in ({"source": "another"}, {"viscous": []}, {"p_delta": False})
    ),
}  # fmt: skip


def patched(table: Table, patch: Mapping[str, Any]) -> Table:
    """The table with the values of a patch, of which `None` takes a key away."""
    inner = {
        name: patched(table.get(name, {}), each) if isinstance(each, dict) else each
        for name, each in patch.items()
    }
    return {name: each for name, each in (table | inner).items() if each is not None}


def told(study: Table, path: Path) -> str:
    """What is said of a study when it is read: a refusal or warnings; empty where it is silent."""
    lines = (f"{name} = {toml_value([each] if name == 'motion' else each)}\n" for name, each in study.items())
    path.write_text("".join(lines))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            return " ".join((*read_study(path).warnings, *(str(each.message) for each in caught)))
        except MrworkError as error:
            return "" if re.search("no key|not TOML", str(error)) else str(error)


def sweep(number: int, seed: int) -> tuple[dict[str, float], list[str]]:
    """Share of each kind that is told, and what is said of honest studies, of `number` studies of either sort."""
    rng, made, heard, false = np.random.default_rng(seed), Counter[str](), Counter[str](), list[str]()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        for index in range(number):
            false += [said] if (said := told(honest(rng), path)) else []
            kind = [*FAULTS][index % len(FAULTS)]
            patch = FAULTS[kind][index // len(FAULTS) % len(FAULTS[kind])]
            made[kind] += 1
            heard[kind] += bool(told(patched(frame(rng, 3), patch(rng) if callable(patch) else patch), path))
    return {kind: heard[kind] / made[kind] for kind in made}, false


if __name__ == "__main__":
    count, first_seed = map(int, [*sys.argv[1:], *("2000", "0")[len(sys.argv) - 1 :]])
    shares, asked = sweep(count, first_seed)
    print(
        "\n".join(
            [*(f"{kind:20} {100.0 * share:5.1f} % told" for kind, share in shares.items()), *asked[:20]]
        )
    )
    print(f"{len(asked)} of {count} honest studies are asked about")
    sys.exit(min(shares.values()) < 0.9 or len(asked) > 0.01 * count)
