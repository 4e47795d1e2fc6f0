"""Models of the package written again as dampers of a user: what they estimate, and what that costs beside the lanes.

python studies/own_dampers/study.py [--quick] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from collections.abc import Sequence
from statistics import median
from typing import Any

import jax.numpy as jnp
import numpy as np

from mrwork import identify, own_damper, read_damper_tests, synthetic_test
from mrwork.dampers import Box, DamperSpec, Loading, damper, simulate_forces
from mrwork.records import DamperTest
from mrwork.report import Table
from mrwork.twins import power
from studies.former.command import Command, Findings, Say
from studies.former.compilation import timed_apart
from studies.former.records import absent, damper_tests
from studies.former.table import table_of

_ROUNDS, _BATCH = 5, 256
LAWS = {
    "hyperbolic_tangent_guo": {"A1": "quadratic", "A2": "linear"},
    "normalised_bouc_wen": {"k_w": "quadratic", "c": "linear"},
}


def guo_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = A1 tanh(A3 (v + omega x)) + A2 (v + omega x) + f0."""
    shifted = velocity + p.omega * displacement
    return p.A1 * jnp.tanh(p.A3 * shifted) + p.A2 * shifted + p.f0


def loop_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = c v + k (x - x0) + k_w w."""
    return p.c * velocity + p.k * (displacement - p.x0) + p.k_w * state[0]


def loop_rate(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """w' = rho (v - sigma |v| |w|^(n-1) w + (sigma - 1) v |w|^n)."""
    w, v = state[0], velocity
    w_n = power(jnp.abs(w), p.n)
    return jnp.stack([p.rho * (v - p.sigma * jnp.abs(v) * jnp.sign(w) * w_n + (p.sigma - 1.0) * v * w_n)])


def own(model: str) -> DamperSpec:
    """A model of the package as a damper of a user."""
    parameters = {each.name: each for each in damper(model).parameters}
    if model == "hyperbolic_tangent_guo":
        return own_damper("own_guo", parameters=parameters, force=guo_force)
    return own_damper(
        "own_bouc_wen", parameters=parameters, force=loop_force, rate=loop_rate, states=1, spring=("k", "x0")
    )


def batch_row(model: str) -> dict[str, Any]:
    """256 candidates on one record: seconds of ours and of the lanes, and how far the forces are apart."""
    specs = own(model), damper(model)
    test = synthetic_test("spencer1997")
    history = Loading(dt=test.dt, displacement=test.displacement, velocity=test.velocity).history()
    unit = np.random.default_rng(0).uniform(0.35, 0.65, (_BATCH, len(specs[1].names)))
    theta = np.asarray(Box.of(specs[1]).theta_from_unit(unit))
    first = timed_apart(lambda: simulate_forces(specs[0], theta, history))
    seconds = [
        median(
            timed_apart(lambda spec=spec: simulate_forces(spec, theta, history))[1] for _ in range(_ROUNDS)
        )
        for spec in specs
    ]
    forces = [simulate_forces(spec, theta, history).force for spec in specs]
    apart = np.linalg.norm(forces[0] - forces[1], axis=1) / np.linalg.norm(forces[1], axis=1)
    return row(f"{_BATCH} candidates", model, seconds, first[2], {"forces apart": float(apart.max())})


def fit_row(what: str, model: str, tests: Sequence[DamperTest], laws: dict[str, str]) -> dict[str, Any]:
    """A fit of both: seconds, and how far the estimates are apart in standard errors."""
    ours, lanes = (spec.with_current_laws(laws) if laws else spec for spec in (own(model), damper(model)))
    (fit, seconds, compiled), (other, others, _) = (
        timed_apart(lambda spec=spec: identify(spec, tests, rng=1)) for spec in (ours, lanes)
    )
    errors = np.array([each.standard_error or np.inf for each in other.estimates])
    apart = np.abs(np.array(fit.theta) - np.array(other.theta)) / errors
    return row(
        what,
        model,
        [seconds, others],
        compiled,
        {
            "apart": float(np.nanmax(apart)),
            "fit": fit.fit_percent,
            "fit of lanes": other.fit_percent,
            "half step": "" if fit.half_step_percent is None else f"{fit.half_step_percent:.1g}",
        },
    )


def row(
    what: str, model: str, seconds: Sequence[float], compiled: float, figures: dict[str, Any]
) -> dict[str, Any]:
    """A row of the table."""
    ours, lanes = seconds
    timings = {"ours": ours, "lanes": lanes, "ratio": ours / lanes, "compiled": compiled}
    return {"what": what, "model": model, **timings, **figures}


def table(title: str, rows: Sequence[dict[str, Any]], further: dict[str, str]) -> Table:
    """Rows as a table, seconds first."""
    timings = {"ours s": "{ours:.3g}", "lanes s": "{lanes:.3g}", "ratio": "{ratio:.1f}"}
    timings["compiled s"] = "{compiled:.2g}"
    return table_of(
        title, "", ((f"{each['what']}, {each['model']}", each) for each in rows), timings | further
    )


def find(options: Namespace, say: Say) -> Findings:
    """Batches, fits of one record, and joint fits of the measured tests with two laws."""
    batches, fits = [], []
    joint: tuple[DamperTest, ...] = ()
    lacking = absent("the measured tests are", damper_tests())
    if not (options.quick or lacking):
        joint = read_damper_tests([damper_tests()])
    for model in LAWS:
        say(f"{model}, {_BATCH} candidates")
        batches.append(batch_row(model))
        say(f"{model}, one record")
        fits.append(fit_row("one record", model, [synthetic_test("spencer1997")], {}))
        if joint:
            say(f"{model}, {len(joint)} tests")
            fits.append(fit_row(f"{len(joint)} tests, two laws", model, joint, LAWS[model]))
    columns = {
        "apart, standard errors": "{apart:.1g}",
        "fit %": "{fit:.3f}",
        "of lanes %": "{fit of lanes:.3f}",
        "half the step %": "{half step}",
    }
    text = [
        table("Batches on one record of 2001 samples", batches, {"forces apart": "{forces apart:.1g}"}),
        table("Fits", fits, columns),
    ]
    return Findings(
        numbers={"batches": batches, "fits": fits}, text=text, judged={}, agreement="", remark=lacking
    )


if __name__ == "__main__":
    command = Command(__file__, __doc__, quick="without the joint fits")
    sys.exit(command.run(find))
