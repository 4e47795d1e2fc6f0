"""Valid calls of fits, of what is known about their uncertainty, and of searches, for tests that make them wrong.

A call is small: wrong arguments that happen to be valid must not take long.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from posterior_samples import MODEL, small_draws, small_fit, small_sampling, small_test
from wrong_arguments import Calls, call

import mrwork as mr
from mrwork import identification, search, uncertainty
from mrwork.identification import Multistart

_QUICK = Multistart(samples=2, starts=1, least_rounds=1, most_rounds=1, found=1, most_iterations=2)
_SPHERE = search.EfficientGA(population=6, stop=search.StopRules(max_generations=2))
_BINGHAM = mr.damper("bingham")
_FREE = {"f_c": (600.0, 600.0), "v_s": (0.01, 0.02)}


def _sphere(unit: np.ndarray) -> np.ndarray:
    return np.sum((unit - 0.3) ** 2, axis=1)


@cache
def _prediction() -> mr.Prediction:
    return mr.predict(small_fit(), _other_test())


@cache
def _begun() -> tuple[Any, Any, np.ndarray]:
    state = _SPHERE.start(2, 0, (0, 1))
    proposal = _SPHERE.ask(state)
    return state, proposal, proposal.accept_misfits(_sphere(proposal.unit))


@cache
def _other_test(frequency: float = 2.0) -> mr.DamperTest:
    time = 0.01 * np.arange(150)
    x, v = (
        0.005 * np.sin(2 * np.pi * frequency * time),
        0.01 * np.pi * frequency * np.cos(2 * np.pi * frequency * time),
    )
    force = mr.simulate_force(
        mr.damper(MODEL), small_fit().theta, mr.Loading(dt=0.01, displacement=x, velocity=v)
    )
    return mr.records.build_damper_test(
        name=f"{frequency:g} Hz", time=time, displacement=x, velocity=v, force=1.1 * force
    )


def _free(coordinates: Any = "theta") -> identification.CandidateObjective:
    return mr.objective(_BINGHAM, small_test(), coordinates=coordinates)


def identification_calls(_: Path) -> Calls:
    """Fits, objectives and their minimisation."""
    theta = _BINGHAM.nominal
    target, start = small_sampling().target, small_sampling().start
    objective = target.objective
    fit, test = small_fit(), small_test()
    return {
        "identify": lambda: call(
            mr.identify,
            model="bingham",
            tests=(test, _other_test()),
            search=_QUICK,
            bounds=_FREE,
            nuisances=("level",),
            observe=("gain=1.1",),
            starts=({"c0": 1000.0},),
            ties={"f0": "0.01*c0"},
            power=2.0,
            force_exponent=1.0,
            engine="lanes",
            rng=1,
            threads=1,
        ),
        "FitSettings": lambda: call(
            identification.FitSettings,
            search=_QUICK,
            bounds=_FREE,
            starts=({"c0": 1000.0},),
            power=2.0,
            force_exponent=1.0,
            engine="lanes",
            nuisances=("offset",),
            observe=("none",),
            rng=0,
        ),
        "FitSettings.of_record": lambda: call(
            identification.FitSettings.of_record, record=identification.FitSettings().as_record()
        ),
        "Multistart": lambda: call(
            Multistart, samples=2, starts=1, least_rounds=1, most_rounds=1, found=1, closeness=0.1
        ),
        "start_from": lambda: call(mr.start_from, fit=fit, model=mr.damper(MODEL)),
        "Fit.observed": lambda: call(fit.observed, test=test),
        "Fit.seen": lambda: call(fit.seen, test=test),
        "Fit.other_condition": lambda: call(fit.other_condition, test=test),
        "Fit.outside": lambda: call(fit.outside, test=test, force=test.force),
        "Fit.verdict_on": lambda: call(fit.verdict_on, name=fit.estimates[0].name),
        "Fit.reading": lambda: call(fit.reading, origin="a"),
        "Objective.of": lambda: call(
            identification.Objective.of,
            spec=_BINGHAM,
            tests=(test,),
            settings=identification.FitSettings(nuisances=("offset",), force_exponent=0.5),
            threads=1,
        ),
        "Objective": lambda: call(objective, theta=start[None], thresholds=np.array([9.0])),
        "Objective.misfits": lambda: call(objective.misfits, theta=start[None]),
        "Objective.residuals": lambda: call(objective.residuals, theta=start[None]),
        "simulate": lambda: call(mr.simulate, model="bingham", theta=theta[None], record=test, threads=1),
        "sensitivities": lambda: call(mr.sensitivities, model=_BINGHAM, theta=theta, record=test, threads=1),
        "ForceSensitivities.by": lambda: call(mr.sensitivities(_BINGHAM, theta, test).by, name="c0"),
        "objective": lambda: call(
            mr.objective,
            model=_BINGHAM,
            tests=(test,),
            bounds=_FREE,
            ties={"f0": "0.01*c0"},
            nuisances=(),
            observe=("gain=1.1",),
            power=4.0,
            force_exponent=0.5,
            weights=[np.linspace(0.0, 1.0, test.n_time)],
            masks=[np.arange(test.n_time) > 3],
            loss="huber",
            loss_scale=100.0,
            coordinates="unit",
            threads=1,
        ),
        "CandidateObjective": lambda: call(_free(), points=theta),
        "CandidateObjective.theta": lambda: call(_free("unit").theta, points=np.full((2, 4), 0.5)),
        "CandidateObjective.residuals": lambda: call(_free().residuals, points=theta),
        "CandidateObjective.jacobian": lambda: call(_free("unit").jacobian, points=np.full(4, 0.5)),
        "CandidateObjective.gradient": lambda: call(_free().gradient, points=theta[None]),
        "search_box": lambda: call(
            identification.search_box, spec=_BINGHAM, bounds=mr.Box.of(_BINGHAM), tests=(test,)
        ),
        "LevelFit": lambda: call(identification.LevelFit, command=1.0, minima=theta[None]),
    }


def uncertainty_calls(folder: Path) -> Calls:
    """Predictions, bands, posteriors and plans."""
    fit, test = small_fit(), small_test()
    return {
        "show_progress": lambda: call(mr.show_progress, patience=1.0),
        "export": lambda: call(
            mr.export, run=fit, to="csv", output=folder / "fit.csv", command=None, replace=True
        ),
        "predict": lambda: call(mr.predict, fit=fit, test=_other_test(), nuisances=("offset",)),
        "predict_left_out": lambda: call(
            uncertainty.predict_left_out,
            tests=[test, _other_test()],
            fold="test",
            identify_rest=lambda tests: small_fit(),
        ),
        "calibrate": lambda: call(mr.calibrate, predictions=[_prediction()], held_out="not seen"),
        "Band": lambda: call(
            uncertainty.Band, kind="prediction", level=0.9, lower=np.zeros(9), upper=np.ones(9), basis="a"
        ),
        "score": lambda: call(
            uncertainty.score,
            band=uncertainty.Band.about(np.zeros(9), 1.0, level=0.9),
            measured=np.linspace(-2.0, 2.0, 9),
            per=2.0,
        ),
        "parameter_band": lambda: call(uncertainty.parameter_band, forces=np.ones((5, 9)), level=0.9),
        "noise_band": lambda: call(
            uncertainty.noise_band,
            forces=np.ones((5, 9)),
            noise_draws=np.full((5, 1), 0.1),
            noise=uncertainty.noise_model("iid"),
            level=0.9,
            deviation=1.0,
            mean=0.0,
            rng=np.random.default_rng(0),
        ),
        "noise_model": lambda: call(uncertainty.noise_model, name="iid"),
        "Candidate": lambda: call(uncertainty.Candidate, amplitude=0.01, frequency=1.0, command=0.5),
        "Limits": lambda: call(uncertainty.Limits, stroke=0.1, peak_velocity=1.0),
        "plan": lambda: call(
            mr.plan,
            fit=fit,
            tests=test,
            candidates=[uncertainty.Candidate(amplitude=0.01, frequency=1.0)],
            band="force",
            targets=[uncertainty.Candidate(amplitude=0.005, frequency=2.0)],
            threads=1,
        ),
        "identifiability_of": lambda: call(mr.identifiability_of, fit=fit, tests=test, threads=1),
        "profile": lambda: call(
            mr.profile, fit=fit, tests=test, parameters=("no such",), level=0.9, threads=1
        ),
        "sample": lambda: call(
            mr.sample,
            fit=fit,
            tests=test,
            noise="iid",
            priors={fit.estimates[0].name: uncertainty.Lognormal(median=1000.0, deviation=1.0)},
            tempering=0.5,
            walkers=16,
            most_steps=2,
            rng=0,
            threads=1,
        ),
        "inference_data": lambda: call(
            uncertainty.inference_data,
            draws=small_draws(),
            fit=fit,
            tests=test,
            priors={},
            pointwise="blocks",
            most_draws=16,
            rng=0,
            threads=1,
        ),
        "Normal": lambda: call(uncertainty.Normal, mean=0.0, deviation=1.0),
        "Lognormal": lambda: call(uncertainty.Lognormal, median=1.0, deviation=1.0),
        "Uniform": lambda: call(uncertainty.Uniform, lower=0.0, upper=1.0),
        "convergence": lambda: call(
            uncertainty.convergence, chains=np.random.default_rng(0).standard_normal((4, 40))
        ),
        "choose_model": lambda: call(
            mr.choose_model,
            tests=(test, _other_test()),
            models=("no such",),
            leave_out="test",
            laws={"f_c": "linear"},
            unit="A",
            lagged=False,
            noise="iid",
            threads=1,
        ),
        "choose_laws": lambda: call(
            mr.choose_laws,
            model=("no such",),
            tests=(test, _other_test()),
            laws={"f_c": "linear"},
            unit="A",
            threads=1,
        ),
    }


def search_calls(_: Path) -> Calls:
    """Optimisers, their states and rules."""
    return {
        "run_search": lambda: call(
            search.run_search,
            optimiser=_SPHERE,
            objective=_sphere,
            rng=0,
            n_params=2,
            seconds=5.0,
            until=0.1,
        ),
        "misfit_under_constraints": lambda: call(
            search.misfit_under_constraints, columns=np.array([[1.0, -1.0], [2.0, 1.0]])
        ),
        "StopRules": lambda: call(
            search.StopRules,
            target=0.1,
            max_generations=3,
            max_evaluations=100,
            spread_tolerance=1e-6,
            confidence=0.9,
            floor_share=0.1,
            stall_generations=3,
            stall_tolerance=0.01,
            min_generations=2,
            max_seconds=9.0,
        ),
        "EliteRule": lambda: call(search.EliteRule, count=3, distance=0.1),
        "Ceiling": lambda: call(search.Ceiling, absolute=3.0),
        "EfficientGA": lambda: call(search.EfficientGA, population=6, elite_share=0.1),
        "StandardGA": lambda: call(
            search.StandardGA, population=6, crossover_probability=0.5, mutation_probability=0.1
        ),
        "ParticleSwarm": lambda: call(
            search.ParticleSwarm, population=6, inertia=(0.9, 0.4), own_attraction=1.0, velocity_limit=0.2
        ),
        "DifferentialEvolution": lambda: call(
            search.DifferentialEvolution,
            population=6,
            base="best",
            factor=(0.5, 1.0),
            crossover_probability=0.5,
        ),
        "EfficientGA.start": lambda: call(_SPHERE.start, n_params=2, rng=0, replicates=(0, 1)),
        "EfficientGA.tell": lambda: call(
            _SPHERE.tell, state=_begun()[0], proposal=_begun()[1], misfit=_begun()[2]
        ),
        "Streams": lambda: call(
            search.Streams, rng=0, replicate=np.array([0, 1]), generation=np.array([0, 0])
        ),
    }


ROOMS = (identification_calls, uncertainty_calls, search_calls)
