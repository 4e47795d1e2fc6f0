"""Valid calls of fits, of what is known about their uncertainty, of searches and figures, to be made wrong.

A call is small: wrong arguments that happen to be valid must not take long.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from plotted_results import RESULTS, calibration, other_test
from posterior_samples import MODEL, small_draws, small_fit, small_sampling, small_test

import mrwork as mr
from mrwork import identification, plots, search, uncertainty
from mrwork.identification import Race
from tests.contract.wrong_arguments import Calls, call, calls_with

_QUICK = Race(samples=2, starts=1, population=5, generations=1, most_rounds=1, most_iterations=2)
_SPHERE = search.EfficientGA(population=6, stop=search.StopRules(max_generations=2))
_BINGHAM = mr.damper("bingham")
_FREE = {"f_c": (600.0, 600.0), "v_s": (0.01, 0.02)}


def _sphere(unit: np.ndarray) -> np.ndarray:
    return np.sum((unit - 0.3) ** 2, axis=1)


@cache
def _prediction() -> mr.Prediction:
    return mr.predict(small_fit(), other_test())


@cache
def _begun() -> tuple[Any, Any, np.ndarray]:
    state = _SPHERE.start(2, 0)
    proposal = _SPHERE.ask(state)
    return state, proposal, _sphere(proposal.unit)


def _free(coordinates: Any = "theta") -> identification.CandidateObjective:
    return mr.objective(_BINGHAM, small_test(), coordinates=coordinates)


def identification_calls(_: Path) -> Calls:
    """Fits, objectives and their minimisation."""
    theta = _BINGHAM.nominal
    target, start = small_sampling().target, small_sampling().target.start
    objective = target.objective
    fit, test = small_fit(), small_test()
    values = {
        **{"model": "bingham", "tests": (test, other_test()), "search": _QUICK, "bounds": _FREE, "rng": 1},
        **{"observe": ("gain=1.1", "offset=each"), "starts": ({"c0": 1000.0},), "threads": 1},
        **{"ties": {"f0": "0.01*c0"}, "force_exponent": 1.0, "engine": "lanes"},
    }
    yield from calls_with(values, identification.FitSettings)
    quick = small_test(n_time=50)
    rest = {name: values[name] for name in ("model", "search", "bounds", "starts", "ties", "engine")}
    yield call(mr.identify, tests=(quick,), **rest)
    # Of one candidate, without effects of each test.
    weighed = {"weights": [np.linspace(0.0, 1.0, test.n_time)], "masks": [np.arange(test.n_time) > 3]}
    huber = {"loss": "huber", "loss_scale": 100.0, "coordinates": "unit", "observe": "gain=1.1"}
    yield from calls_with(values | weighed | huber | {"tests": (test,)}, mr.objective)
    yield call(Race, samples=2, starts=1, population=5, generations=2, most_rounds=1)
    yield call(mr.start_from, fit=fit, model=mr.damper(MODEL))
    asked = {"test": test, "force": test.force}
    yield from calls_with(asked, fit.observed, fit.seen, fit.other_condition, fit.outside)
    settings = identification.FitSettings(observe="offset=each", force_exponent=0.5)
    yield call(identification.Objective.of, spec=_BINGHAM, tests=(test,), settings=settings, threads=1)
    yield call(objective, theta=start[None], shares=np.array([[1.0]]))
    yield from calls_with({"theta": start[None]}, objective.misfits, objective.residuals)
    yield call(mr.simulate, model="bingham", theta=theta[None], record=test, threads=1)
    yield call(mr.sensitivities, model=_BINGHAM, theta=theta, record=test, threads=1)
    yield call(mr.sensitivities(_BINGHAM, theta, test).by, name="c0")
    yield call(_free(), points=theta)
    yield call(_free("unit").theta, points=np.full((2, 4), 0.5))
    yield call(_free().residuals, points=theta)
    yield call(_free("unit").jacobian, points=np.full(4, 0.5))
    yield call(_free().gradient, points=theta[None])
    yield call(identification.search_box, spec=_BINGHAM, bounds=mr.Box.of(_BINGHAM), tests=(test,))


def jax_calls(_: Path) -> Calls:
    """Functions of JAX, which are made and not called: that compiles them."""
    values = {"model": "bingham", "substeps": 2, "threads": 1, "coordinates": "unit"}
    yield call(mr.jax.force, record=small_test(), **values)
    for kind in (mr.jax.residuals, mr.jax.misfit):
        yield call(kind, tests=[small_test()], **values)
    yield call(mr.jax.log_likelihood, tests=small_test(), noise="ar1", **values)
    yield call(mr.jax.twin(_BINGHAM).substeps, theta=np.array(_BINGHAM.nominal), record=small_test())


def uncertainty_calls(folder: Path) -> Calls:
    """Predictions, bands, posteriors and plans."""
    fit, test = small_fit(), small_test()
    yield call(mr.export, run=fit, to="csv", output=folder / "fit.csv", command=None, replace=True)
    yield call(mr.save, result=fit, folder=folder / "saved")
    yield call(mr.predict, fit=fit, test=other_test(), observe="offset=each")
    calibration = mr.calibrate([_prediction()], held_out="not seen")
    yield call(mr.predict, fit=fit, test=[other_test()], calibration=calibration, level=0.9)
    left_out = {"tests": [test, other_test()], "identify_rest": lambda tests: small_fit()}
    yield call(uncertainty.predict_left_out, fold="test", **left_out)
    yield call(uncertainty.predict_beyond, **left_out)
    yield call(mr.calibrate, predictions=[_prediction()], held_out="not seen", beyond=[_prediction()])
    yield call(uncertainty.Band, level=0.9, lower=np.zeros(9), upper=np.ones(9), basis="a")
    band = uncertainty.Band.about(np.zeros(9), 1.0, level=0.9)
    yield call(uncertainty.score, band=band, measured=np.linspace(-2.0, 2.0, 9), per=2.0)
    values = {
        **{"fit": fit, "tests": test, "level": 0.9, "threads": 1, "rng": 0, "draws": small_draws()},
        **{"candidates": [uncertainty.Candidate(amplitude=0.01, frequency=1.0)], "band": "force"},
        **{"targets": [uncertainty.Candidate(amplitude=0.005, frequency=2.0)]},
        **{"noise": "iid", "tempering": 0.5, "walkers": 16, "most_steps": 2},
        "priors": {fit.estimates[0].name: uncertainty.Lognormal(median=1000.0, deviation=1.0)},
    }
    yield from calls_with(values, mr.plan, mr.sample)
    data = {"pointwise": "blocks", "most_draws": 16}
    yield from calls_with(values | data, uncertainty.inference_data)
    yield call(uncertainty.convergence, chains=np.random.default_rng(0).standard_normal((4, 40)))


def search_calls(_: Path) -> Calls:
    """Optimisers, their states and rules."""
    yield call(
        search.run_search, optimiser=_SPHERE, objective=_sphere, rng=0, n_params=2, seconds=5.0, until=0.1
    )
    rules = {
        **{"target": 0.1, "max_generations": 3, "max_evaluations": 100, "spread_tolerance": 1e-6},
        **{"confidence": 0.9, "floor_share": 0.1, "stall_generations": 3, "stall_tolerance": 0.01},
        **{"min_generations": 2, "max_seconds": 9.0},
    }
    yield call(search.StopRules, **rules)
    yield call(search.ParticleSwarm, population=6, inertia=(0.9, 0.4), own_attraction=1.0, velocity_limit=0.2)
    yield call(
        search.DifferentialEvolution, population=6, base="best", factor=(0.5, 1.0), crossover_probability=0.5
    )
    yield call(_SPHERE.start, n_params=2, rng=0)
    yield call(_SPHERE.tell, state=_begun()[0], proposal=_begun()[1], misfit=_begun()[2])


def plots_calls(_: Path) -> Calls:
    """Every figure, into axes that are no one's."""
    axes = Figure().subplots()
    values = {
        **{"ax": axes, "legend": False, "test": None, "signal": "drift", "over": "velocity", "device": 1},
        "motion": 1,
        **{"parameters": ("k_w",), "calibration": calibration(), "level": 0.9, "law": None, "damping": 0.02},
        **{"periods": np.array([0.5, 1.0]), "rows": (0, 1)},
    }
    for figure, result, own in (
        (plots.histories, "Fit", {"test": "0.7 A"}),
        (plots.loops, "History", {}),
        (plots.residuals, "Prediction", {"test": 0}),
        (plots.commands, "History", {"device": 0}),
        (plots.laws, "Fit", {"parameters": ("f_c",)}),
        (plots.profiles, "Profiles", {}),
        (plots.posterior, "Draws", {}),
        (plots.bands, "Prediction", {"over": "time"}),
        (plots.spectra, "GroundMotion", {"quantity": "displacement"}),
        (plots.storey_profiles, "Responses", {"quantity": "peak_drift", "rows": (0, "candidate 2")}),
        (plots.energies, "StudyResults", {"motion": 0}),
        (plots.fronts, "Front", {}),
        (plots.ida, "Fragilities", {"rows": (0,)}),
        (plots.fragility, "Fragilities", {"rows": (0, "Passive-off")}),
    ):
        yield from calls_with({**values, "result": RESULTS[result](), **own}, figure)
    yield call(plots.drawn_data, figure=axes)


ROOMS = (identification_calls, jax_calls, uncertainty_calls, search_calls, plots_calls)
