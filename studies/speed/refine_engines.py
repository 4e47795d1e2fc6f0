"""Who takes part in `study.py refine`: a start goes in, a minimum comes out, and how many simulations it took."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mrwork.identification import find_minima, find_minimum
from studies.former.arrays import Floats
from studies.speed.refine_job import RefineJob

_MOST = 100
_STEP = 1e-6
_TOLERANCE = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class Refined:
    """Misfits of the starts, shape (n_starts,), and simulations of each on average."""

    misfit: Floats
    simulations: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Engine:
    """Refines starts, shape (n_starts, n_params); `at_once` of them in one call, of which each has its share."""

    name: str
    run: Callable[[Floats], Refined]
    at_once: int = 1
    is_ours: bool = True


def engines(job: RefineJob, peer: Callable[[Floats], Floats] | None) -> list[Engine]:
    """Ours, optimistix on our kernel, and SciPy on the `peer`'s residuals, shape (n_rows, n_residuals), if any."""
    objective, box = job.objective, job.box

    def counted(run: Callable[[Floats], Floats]) -> Callable[[Floats], Refined]:
        def refined(starts: Floats) -> Refined:
            before = objective.tally.simulations
            misfit = run(starts)
            return Refined(misfit=misfit, simulations=(objective.tally.simulations - before) / len(starts))

        return refined

    def scipy_on_rust(starts: Floats) -> Floats:
        return np.array(
            [find_minimum(objective, box, start, max_evaluations=_MOST).misfit for start in starts]
        )

    def side_by_side(starts: Floats) -> Floats:
        return find_minima(objective, box, starts, max_iterations=_MOST).misfit

    def optimistix(starts: Floats) -> Floats:
        from mrwork.identification import find_minimum_by_optimistix

        return np.array([find_minimum_by_optimistix(objective, box, start).misfit for start in starts])

    found = [
        Engine(name="rust, SciPy lm", run=counted(scipy_on_rust)),
        Engine(name="rust, side by side", run=counted(side_by_side)),
        Engine(name="rust, 16 starts at once", run=counted(side_by_side), at_once=16),
        Engine(name="rust, optimistix", run=counted(optimistix)),
    ]
    if peer is not None:
        found.append(Engine(name="numba, SciPy lm", run=_on_peer(job, peer), is_ours=False))
    return found


def _on_peer(job: RefineJob, peer: Callable[[Floats], Floats]) -> Callable[[Floats], Refined]:
    def run(starts: Floats) -> Refined:
        minima = [_descended(job, peer, start) for start in starts]
        return Refined(
            misfit=np.array([misfit for misfit, _ in minima]),
            simulations=float(np.mean([simulations for _, simulations in minima])),
        )

    return run


def _descended(job: RefineJob, peer: Callable[[Floats], Floats], start: Floats) -> tuple[float, int]:
    """The method of `find_minimum` with forward differences, all columns in one batch; residuals there are known."""
    from scipy.optimize import least_squares

    box = job.box
    known: list[tuple[Floats, Floats]] = []
    simulations = 0
    origin = np.asarray(box.latent_from_theta(box.inside(start)))

    def residuals(latent: Floats) -> Floats:
        nonlocal simulations
        for place, found in known:
            if np.array_equal(place, latent):
                return found
        found = np.asarray(peer(np.asarray(box.theta_from_latent(latent))[None])[0])
        simulations += 1
        known[:] = [(latent.copy(), found), *known[:1]]
        return np.asarray(found)

    def jacobian(latent: Floats) -> Floats:
        nonlocal simulations
        at = residuals(latent)
        theta = np.asarray(box.theta_from_latent(latent[None] + _STEP * np.eye(len(latent))))
        simulations += len(latent)
        return np.asarray((peer(theta) - at).T / _STEP)

    norm = np.linalg.norm(jacobian(origin), axis=0)
    scale = 1.0 / np.maximum(norm, 1e-9 * norm.max())

    def residuals_at(position: Floats) -> Floats:
        return residuals(origin + scale * position)

    def jacobian_at(position: Floats) -> Floats:
        return np.asarray(jacobian(origin + scale * position) * scale)

    solution = least_squares(
        residuals_at,
        np.zeros_like(origin),
        jac=jacobian_at,
        method="lm",
        x_scale=0.003,
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        max_nfev=_MOST,
    )
    return float(np.linalg.norm(np.asarray(solution.fun))), simulations
