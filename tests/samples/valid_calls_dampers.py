"""Valid calls of public functions on dampers, tests, motions, fits and searches, for tests that make them wrong.

A call is small: wrong arguments that happen to be valid must not take long.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from posterior_samples import MODEL, small_fit, small_sampling, small_test

import mrwork as mr
from mrwork import search, uncertainty
from mrwork.identification import Multistart
from mrwork.simulate import simulate_forces, simulate_misfits, simulate_sensitivities


class ValidCall(NamedTuple):
    """A function, and arguments that it takes."""

    function: Callable[..., object]
    arguments: Mapping[str, Any]


_N_TIME = 60
_QUICK = Multistart(samples=2, starts=1, least_rounds=1, most_rounds=1, found=1, most_iterations=2)
_SPHERE = search.EfficientGA(population=6, stop=search.StopRules(max_generations=2))
_BINGHAM = mr.damper("bingham")
_FREE = {
    name: (value, value) for name, value in zip(_BINGHAM.names, _BINGHAM.nominal, strict=True) if name != "c0"
}


_FIELDS = (
    *("name", "path", "sha256", "dt", "start_time", "displacement", "velocity", "force", "velocity_source"),
    *("n_settle", "amplitude", "frequency", "observation", "findings"),
)


def _sphere(unit: np.ndarray) -> np.ndarray:
    return np.sum((unit - 0.3) ** 2, axis=1)


@cache
def _loading() -> mr.Loading:
    time = 0.01 * np.arange(_N_TIME)
    return mr.Loading(
        dt=0.01,
        displacement=0.01 * np.sin(6.0 * time),
        velocity=0.06 * np.cos(6.0 * time),
        command=np.full(_N_TIME, 0.5),
        command_unit="A",
    )


@cache
def _motion() -> mr.GroundMotion:
    return mr.synthetic_motion(duration=6.0, dt=0.02, peak=3.0)


@cache
def _prediction() -> mr.Prediction:
    return mr.predict(small_fit(), _other_test())


@cache
def _begun() -> tuple[Any, Any, np.ndarray]:
    state = _SPHERE.start(2, 0, (0, 1))
    proposal = _SPHERE.ask(state)
    return state, proposal, proposal.accepted(_sphere(proposal.unit))


def calls(files: Path) -> dict[str, Callable[[], ValidCall]]:
    """Valid calls by the name of what is called, made when they are asked for; `files` is a folder to write to."""

    def record() -> Path:
        path = files / "rig.csv"
        test = small_test()
        columns = np.column_stack([test.time, test.displacement, test.force])
        np.savetxt(path, columns, delimiter=",", header="t_s,displacement_m,force_N", comments="")
        return path

    def accelerogram(timed: bool = False) -> Path:
        path = files / ("timed.csv" if timed else "motion.csv")
        columns = [_motion().time, _motion().acceleration][0 if timed else 1 :]
        np.savetxt(
            path, np.column_stack(columns), delimiter=",", header="t_s,a_g" if timed else "", comments=""
        )
        return path

    def call(function: Callable[..., object], **arguments: Any) -> ValidCall:
        return ValidCall(function, arguments)

    theta = _BINGHAM.nominal
    laws = _BINGHAM.with_current_laws({"f_c": "linear"})
    bouc_wen = mr.damper("bouc_wen").nominal
    target = small_sampling().target
    start = small_sampling().start
    objective = target.objective
    box = target.form.box
    fit, test, motion = small_fit(), small_test(), _motion()
    dampers, motions, records, identification = mr.dampers, mr.motions, mr.records, mr.identification
    rows = np.tile(theta, (3, 1))
    history = _loading().history()
    return {
        # Dampers
        "damper": lambda: call(mr.damper, name="bingham"),
        "DamperSpec.with_current_laws": lambda: call(
            _BINGHAM.with_current_laws, laws={"f_c": "linear"}, unit="A", lagged=True
        ),
        "DamperSpec.preset": lambda: call(mr.damper("modified_bouc_wen").preset, name="dyke1996"),
        "Box": lambda: call(
            mr.Box, names=("c", "f0"), lower=(1.0, -5.0), upper=(9.0, 5.0), log=(True, False)
        ),
        "Box.of": lambda: call(mr.Box.of, spec=_BINGHAM),
        "Box.with_bounds": lambda: call(mr.Box.of(_BINGHAM).with_bounds, bounds={"f_c": (1.0, 2.0)}),
        "Box.theta_from_unit": lambda: call(box.theta_from_unit, unit=np.full((4, len(box.names)), 0.5)),
        "Box.unit_from_theta": lambda: call(box.unit_from_theta, theta=np.array(box.lower)),
        "Box.theta_from_latent": lambda: call(box.theta_from_latent, latent=np.zeros(len(box.free))),
        "Box.latent_from_theta": lambda: call(
            box.latent_from_theta, theta=0.5 * (np.array(box.lower) + box.upper)
        ),
        "Box.inside": lambda: call(box.inside, theta=np.array(box.lower)),
        "OpenSeesBoucWen": lambda: call(
            dampers.OpenSeesBoucWen, alpha=0.1, ko=1e5, n=2.0, gamma=100.0, beta=100.0, Ao=1.0
        ),
        "bouc_wen_from_opensees": lambda: call(
            dampers.bouc_wen_from_opensees,
            material=dampers.OpenSeesBoucWen(alpha=0.1, ko=1e5, n=2.0, gamma=100.0, beta=100.0, Ao=1.0),
            c0=10.0,
        ),
        "opensees_from_bouc_wen": lambda: call(
            dampers.opensees_from_bouc_wen, theta=bouc_wen * (np.arange(8) != 2), Ao=1.0
        ),
        "normalised_from_bouc_wen": lambda: call(dampers.normalised_from_bouc_wen, theta=bouc_wen),
        "bouc_wen_from_normalised": lambda: call(
            dampers.bouc_wen_from_normalised, theta=mr.damper("normalised_bouc_wen").nominal, A=1.0
        ),
        "normalised_from_modified_bouc_wen": lambda: call(
            dampers.normalised_from_modified_bouc_wen, theta=mr.damper("modified_bouc_wen").nominal
        ),
        "modified_bouc_wen_from_normalised": lambda: call(
            dampers.modified_bouc_wen_from_normalised,
            theta=mr.damper("normalised_modified_bouc_wen").nominal,
            A=1.0,
        ),
        "rescaled_bouc_wen": lambda: call(dampers.rescaled_bouc_wen, theta=bouc_wen, A=2.0),
        # Simulation
        "Loading": lambda: call(
            mr.Loading,
            dt=0.01,
            displacement=_loading().displacement,
            velocity=_loading().velocity,
            command=_loading().command,
            command_unit="A",
        ),
        "simulate_force": lambda: call(
            mr.simulate_force, spec=_BINGHAM, theta=theta, loading=_loading(), substep_factor=1
        ),
        "simulate_force, laws": lambda: call(
            mr.simulate_force, spec=laws, theta=laws.nominal, loading=_loading()
        ),
        "simulate_misfits": lambda: call(
            simulate_misfits,
            spec=_BINGHAM,
            theta=rows,
            history=history,
            force=np.ones(_N_TIME),
            first=2,
            limits=np.full(3, 1e9),
            substep_factor=1,
            threads=1,
        ),
        "simulate_forces": lambda: call(
            simulate_forces, spec=_BINGHAM, theta=rows, history=history, threads=1
        ),
        "simulate_sensitivities": lambda: call(
            simulate_sensitivities, spec=_BINGHAM, theta=rows, history=history, columns=[0, 1], threads=1
        ),
        "synthetic_test": lambda: call(mr.synthetic_test, name="spencer1997"),
        # Records
        "read_damper_test": lambda: call(mr.read_damper_test, path=record(), columns={"force": "force_N:kN"}),
        "read_damper_tests": lambda: call(
            mr.read_damper_tests, paths=[record()], columns={"force": "force_N:kN"}
        ),
        "build_damper_test": lambda: call(
            records.build_damper_test,
            name="rig",
            time=test.time,
            displacement=test.displacement,
            force=test.force,
            velocity=test.velocity,
            current=np.full(test.n_time, 0.5),
            voltage=1.0,
            amplitude=0.01,
            frequency=1.0,
            synthetic=True,
            path="rig.csv",
            sha256="0",
            locate=str,
        ),
        "DamperTest": lambda: call(
            mr.DamperTest,
            **{name: getattr(test, name) for name in _FIELDS},
            current=np.full(test.n_time, 0.5),
        ),
        "DamperTest.part": lambda: call(test.part, first=2, last=100, every=2),
        "cut": lambda: call(records.cut, test=test, start=0.1, end=1.5, every=2),
        "repair": lambda: call(records.repair, test=test, kinds=["offset"], amounts={"offset": 3.0}),
        "observed": lambda: call(records.observed, test=test, observe=["average=0.02", "gain=1.1"]),
        "Observation": lambda: call(
            records.Observation,
            delay_seconds=0.01,
            lowpass_hz=20.0,
            average_seconds=0.02,
            gain=1.1,
            offset=3.0,
        ),
        "Observation.observe": lambda: call(
            records.Observation(delay_seconds=0.02, average_seconds=0.05, lowpass_hz=20.0).observe,
            force=test.force,
            dt=test.dt,
        ),
        "mislabelled": lambda: call(records.mislabelled, tests=[test, _other_test(), _other_test()]),
        "detect_smoothing": lambda: call(records.detect_smoothing, test=test),
        "parse_column_option": lambda: call(records.parse_column_option, option="force=F:kN"),
        "guess_tests": lambda: call(records.guess_tests, files=[record()]),
        "ListedTest": lambda: call(
            records.ListedTest, file="rig.csv", use="fit", columns={"force": "F:kN"}, doubt="none"
        ),
        "write_test_table": lambda: call(
            records.write_test_table,
            path=files / "tests.csv",
            rows=[records.ListedTest(file=str(record()), use="fit")],
        ),
        "read_test_table": lambda: call(records.read_test_table, path=files / "none.csv"),
        "OperatingRange.of_test": lambda: call(
            records.OperatingRange.of_test, test=test, unit="A", force=test.force
        ),
        "OperatingRange.of_tests": lambda: call(
            records.OperatingRange.of_tests, tests=[test, test], unit="A"
        ),
        "OperatingRange.exceeded_by": lambda: call(
            records.OperatingRange.of_test(test, None).exceeded_by,
            demand=records.OperatingRange.of_test(test, None),
        ),
        "RecordedMotion.of": lambda: call(records.RecordedMotion.of, test=test),
        "RecordedMotion.correlation": lambda: call(
            records.RecordedMotion.of(test).correlation, seen=records.RecordedMotion.of(small_test(6))
        ),
        # Motions
        "GroundMotion": lambda: call(
            mr.GroundMotion,
            name="a",
            dt=0.01,
            acceleration=np.sin(np.arange(50.0)),
            source="",
            changes=("x",),
        ),
        "read_motion": lambda: call(mr.read_motion, path=accelerogram(), unit="g", dt=0.02),
        "read_motions": lambda: call(mr.read_motions, paths=[accelerogram(True)], unit="g"),
        "synthetic_motion": lambda: call(
            mr.synthetic_motion,
            spectrum=motions.KanaiTajimi(),
            rng=3,
            duration=2.0,
            dt=0.02,
            envelope=motions.Envelope(),
            peak=2.0,
            name="a",
        ),
        "suite": lambda: call(
            motions.suite, soil=("firm", "soft"), n=2, rng=0, pulses="both", peak=2.0, dt=0.05, name="a"
        ),
        "response_spectrum": lambda: call(
            mr.response_spectrum, motion=motion, periods=[0.2, 1.0], damping=0.05
        ),
        "fitted_spectrum": lambda: call(motions.fitted_spectrum, motion=motion, kind="kanai_tajimi"),
        "is_copy": lambda: call(motions.is_copy, one=motion, other=motion),
        "baseline_corrected": lambda: call(motions.baseline_corrected, motion=motion, order=1),
        "brought_to_rest": lambda: call(motions.brought_to_rest, motion=motion),
        "resampled": lambda: call(motions.resampled, motion=motion, dt=0.01),
        "resampled_band_limited": lambda: call(motions.resampled_band_limited, motion=motion, dt=0.04),
        "scaled": lambda: call(motions.scaled, motion=motion, factor=2.0),
        "scaled_to_peak": lambda: call(motions.scaled_to_peak, motion=motion, peak=2.0),
        "time_scaled": lambda: call(motions.time_scaled, motion=motion, factor=0.5),
        "trimmed": lambda: call(motions.trimmed, motion=motion, start=0.5, end=1.5),
        "half_sine": lambda: call(motions.half_sine, amplitude=1.0, width=0.5, rest=0.1, dt=0.01),
        "ricker": lambda: call(motions.ricker, amplitude=1.0, frequency=2.0, dt=0.01),
        "sine": lambda: call(motions.sine, amplitude=1.0, frequency=2.0, cycles=2.0, dt=0.01),
        "sine_sweep": lambda: call(
            motions.sine_sweep, amplitude=1.0, start=1.0, end=3.0, duration=2.0, dt=0.01
        ),
        "near_fault_pulse": lambda: call(
            motions.near_fault_pulse, amplitude=1.0, period=1.0, cycles=1.5, phase=0.3, dt=0.02
        ),
        "KanaiTajimi": lambda: call(motions.KanaiTajimi, frequency=10.0, damping=0.5, intensity=0.01),
        "KanaiTajimi.density": lambda: call(motions.KanaiTajimi().density, w=np.linspace(0.1, 50.0, 5)),
        "CloughPenzien": lambda: call(
            motions.CloughPenzien, soil=motions.KanaiTajimi(), frequency=1.5, damping=0.6
        ),
        "CloughPenzien.transfer": lambda: call(motions.CloughPenzien().transfer, w=np.linspace(0.1, 50.0, 5)),
        "Envelope": lambda: call(motions.Envelope, rise=1.0, plateau_end=2.0, decay=0.1),
        "Envelope.at": lambda: call(motions.Envelope().at, time=np.linspace(0.0, 20.0, 5)),
        "GammaEnvelope": lambda: call(motions.GammaEnvelope, significant_duration=5.0, shape=5.0),
        "GammaEnvelope.time_of": lambda: call(
            motions.GammaEnvelope(significant_duration=5.0).time_of, share=0.5
        ),
        # Identification
        "identify": lambda: call(
            mr.identify,
            model="bingham",
            tests=(test, _other_test()),
            search=_QUICK,
            bounds=_FREE,
            nuisances=("level",),
            observe=("gain=1.1",),
            starts=({"c0": 1000.0},),
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
        "Fit.outside": lambda: call(fit.outside, test=test, force=test.force),
        "Fit.verdict_on": lambda: call(fit.verdict_on, name=fit.estimates[0].name),
        "Fit.reading": lambda: call(fit.reading, origin="a"),
        "Objective.of": lambda: call(
            identification.Objective.of,
            spec=_BINGHAM,
            tests=(test,),
            nuisances=("offset",),
            power=2.0,
            force_exponent=0.5,
            threads=1,
        ),
        "Objective": lambda: call(objective, theta=start[None], thresholds=np.array([9.0])),
        "Objective.misfits": lambda: call(objective.misfits, theta=start[None]),
        "Objective.residuals": lambda: call(objective.residuals, theta=start[None]),
        "find_minimum": lambda: call(
            identification.find_minimum, objective=objective, box=box, start=start, max_evaluations=2
        ),
        "find_minima": lambda: call(
            identification.find_minima,
            objective=objective,
            box=box,
            starts=start[None],
            max_iterations=2,
            tolerance=1e-7,
        ),
        "search_starts": lambda: call(
            identification.search_starts,
            objective=objective,
            box=box,
            searched=identification.search_box(mr.damper(MODEL), box, (test,)),
            settings=_QUICK,
            rng=0,
            mirrored=(0,),
            nested=start[None],
        ),
        "search_box": lambda: call(
            identification.search_box, spec=_BINGHAM, bounds=mr.Box.of(_BINGHAM), tests=(test,)
        ),
        "free_run": lambda: call(
            identification.free_run, spec=_BINGHAM, theta=theta, test=test, nuisances=("level",)
        ),
        "identifiable_form": lambda: call(identification.identifiable_form, spec=_BINGHAM, bounds=_FREE),
        "levels_of": lambda: call(
            identification.levels_of, spec=laws, tests=[_with_command(0.0), _with_command(1.0)]
        ),
        "joint_starts": lambda: call(
            identification.joint_starts,
            spec=laws,
            levels=[
                identification.LevelFit(command=each, minima=theta[None], search=None) for each in (0.0, 1.0)
            ],
            n_starts=2,
            rng=0,
        ),
        "LevelFit": lambda: call(identification.LevelFit, command=1.0, minima=theta[None], search=None),
        # Uncertainty
        "predict": lambda: call(mr.predict, fit=fit, test=_other_test(), nuisances=("offset",)),
        "predict_left_out": lambda: call(
            uncertainty.predict_left_out,
            tests=[test, _other_test()],
            fold="test",
            identify_rest=lambda tests: small_fit(),
        ),
        "calibrate": lambda: call(mr.calibrate, predictions=[_prediction()], held_out="not seen"),
        "measured_coverage": lambda: call(
            uncertainty.measured_coverage,
            predictions=[_prediction(), mr.predict(fit, _other_test(3.0))],
            levels=(0.5,),
        ),
        "Band": lambda: call(
            uncertainty.Band, kind="prediction", level=0.9, lower=np.zeros(9), upper=np.ones(9), basis="a"
        ),
        "Band.about": lambda: call(
            uncertainty.Band.about, centre=np.zeros(9), half=np.ones(9), level=0.9, basis="a"
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
        "simulate_draws": lambda: call(
            uncertainty.simulate_draws, spec=_BINGHAM, theta=rows, test=test, threads=1
        ),
        "noise_model": lambda: call(uncertainty.noise_model, name="iid"),
        "Noise.draw": lambda: call(
            uncertainty.noise_model("iid").draw,
            force=np.ones((5, 9)),
            noise=np.full((5, 1), 0.1),
            rng=np.random.default_rng(0),
        ),
        "Noise.estimate": lambda: call(
            uncertainty.noise_model("iid").estimate, residual=np.linspace(0.0, 1.0, 9), force=np.ones(9)
        ),
        "Candidate": lambda: call(uncertainty.Candidate, amplitude=0.01, frequency=1.0, command=0.5),
        "Candidate.in_words": lambda: call(
            uncertainty.Candidate(amplitude=0.01, frequency=1.0).in_words, unit="A"
        ),
        "Limits": lambda: call(uncertainty.Limits, stroke=0.1, peak_velocity=1.0),
        "Limits.allow": lambda: call(
            uncertainty.Limits(stroke=0.1).allow,
            candidate=uncertainty.Candidate(amplitude=0.01, frequency=1.0),
        ),
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
        "Normal": lambda: call(uncertainty.Normal, mean=0.0, deviation=1.0),
        "Lognormal": lambda: call(uncertainty.Lognormal, median=1.0, deviation=1.0),
        "Uniform": lambda: call(uncertainty.Uniform, lower=0.0, upper=1.0),
        "convergence": lambda: call(
            uncertainty.convergence, chains=np.random.default_rng(0).standard_normal((4, 40))
        ),
        "kept": lambda: call(uncertainty.kept, n_steps=40),
        "Target.of": lambda: call(
            uncertainty.Target.of,
            form=target.form,
            objective=objective,
            noise=uncertainty.noise_model("iid"),
            start=start,
            priors={},
            tempering=0.5,
        ),
        "Target": lambda: call(target, position=target.position_of(start)[None]),
        "Target.log_likelihood": lambda: call(
            target.log_likelihood, values=np.concatenate([start, [0.1]])[None]
        ),
        "Target.noise_at": lambda: call(target.noise_at, theta=start),
        "Target.position_of": lambda: call(target.position_of, theta=start),
        "first_walkers": lambda: call(
            uncertainty.first_walkers, target=target, start=start, n_walkers=8, rng=np.random.default_rng(0)
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
            model="no such",
            tests=(test, _other_test()),
            laws={"f_c": "linear"},
            unit="A",
            threads=1,
        ),
        # Searches
        "run_search": lambda: call(
            search.run_search, optimiser=_SPHERE, objective=_sphere, rng=0, n_params=2
        ),
        "run_replicates": lambda: call(
            search.run_replicates, optimiser=_SPHERE, objective=_sphere, rng=0, n_params=2, replicates=(0, 3)
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
        "Proposal.accepted": lambda: call(_begun()[1].accepted, misfit=_begun()[2]),
        "distinct_best": lambda: call(
            search.distinct_best,
            population=np.random.default_rng(0).random((2, 5, 3)),
            misfit=np.random.default_rng(0).random((2, 5)),
            rule=search.EliteRule(count=2),
        ),
        "expected_termination": lambda: call(
            search.expected_termination, best=np.array([5.0, 4.0, 1.0, 0.5]), confidence=0.9, floor=0.1
        ),
        "Streams": lambda: call(
            search.Streams, rng=0, replicate=np.array([0, 1]), generation=np.array([0, 0])
        ),
        "Streams.uniform": lambda: call(_streams().uniform, count=3),
        "Streams.normal": lambda: call(_streams().normal, count=np.array([3, 2])),
        "latin_hypercube": lambda: call(search.latin_hypercube, streams=_streams(), count=4, n_params=2),
        "library": lambda: call(search.library, name="scipy"),
        "select": lambda: call(search.select, state=_begun()[0], rows=[0]),
        "state_from_arrays": lambda: call(
            search.state_from_arrays, kind=type(_begun()[0]), arrays=search.arrays_of(_begun()[0])
        ),
    }


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


def _streams() -> search.Streams:
    return search.Streams(rng=0, replicate=np.array([0, 1]), generation=np.array([0, 0]))


@cache
def _with_command(current: float) -> mr.DamperTest:
    test = small_test()
    return mr.records.build_damper_test(
        name="rig", time=test.time, displacement=test.displacement, force=test.force, current=current
    )
