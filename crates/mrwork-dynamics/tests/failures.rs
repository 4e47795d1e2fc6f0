//! Candidates that fail have named outcomes, batches that fail have named errors, and neither harms what stands beside it.

#![allow(clippy::cast_precision_loss, clippy::expect_used, clippy::float_cmp)] // exact comparison is what is claimed

mod batches;

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use batches::{batch, constant, default, forces, loading, nominal};
use mrwork_dynamics::damper::{REGISTRY, find};
use mrwork_dynamics::error::{DynamicsError, Outcome};
use mrwork_dynamics::misfit::Target;
use mrwork_dynamics::simulate::{CandidateResult, Settings, force_histories, misfits};

#[test]
fn a_stiff_candidate_is_unresolved_and_not_simulated() {
    let damper = find("normalised_bouc_wen").expect("a registered model");
    let mut theta = nominal(damper);
    theta[4] = 1e9; // rho: yields within a nanometre
    let (rows, force) = forces(damper, &theta, &loading(100), default());
    assert_eq!(
        rows[0],
        CandidateResult { squared_error: f64::INFINITY, outcome: Outcome::Unresolved, substeps: 0, steps: 0 }
    );
    assert!(force.iter().all(|&force| force == f64::INFINITY));
}

#[test]
fn a_loop_without_bound_is_unresolved() {
    let damper = find("bouc_wen").expect("a registered model");
    let mut theta = nominal(damper);
    theta[5] = -2.0 * theta[4]; // beta + gamma < 0
    let (rows, _) = forces(damper, &theta, &loading(100), default());
    assert_eq!(rows[0].outcome, Outcome::Unresolved);
}

#[test]
fn a_candidate_whose_force_overflows_diverges_and_leaves_its_neighbours_alone() {
    let loading = loading(600);
    for &damper in REGISTRY {
        let parameters = damper.spec().parameters;
        let clean = batch(damper, 20);
        let mut theta = clean.clone();
        // The force is a sum of terms with one of these each: it overflows, or its square does.
        for (value, parameter) in theta[7 * parameters.len()..].iter_mut().zip(parameters) {
            if parameter.unit.starts_with('N') {
                *value = f64::MAX;
            }
        }
        let measured = vec![0.0; loading.n_time()];
        let target = Target { force: &measured, first: 0 };
        let before = misfits(damper, &constant(damper), &clean, &loading, target, None, default())
            .expect("a batch that runs");
        let after = misfits(damper, &constant(damper), &theta, &loading, target, None, default())
            .expect("a batch that runs");
        // Where such a number enters the stiffness bound, the candidate is not even simulated.
        let row = &theta[7 * parameters.len()..8 * parameters.len()];
        let resolved = damper.substeps(row, &constant(damper), &loading, 1).is_some();
        let expected = if resolved { Outcome::Diverged } else { Outcome::Unresolved };
        assert_eq!(after[7].outcome, expected, "{}", damper.spec().name);
        assert_eq!(after[7].squared_error, f64::INFINITY);
        for row in (0..20).filter(|&row| row != 7) {
            assert_eq!(after[row], before[row]);
        }
    }
}

#[test]
fn parameters_that_are_no_numbers_fail_by_name() {
    let loading = loading(600);
    let measured = vec![0.0; loading.n_time()];
    for &damper in REGISTRY {
        for parameter in 0..damper.spec().parameters.len() {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut theta = nominal(damper);
                theta[parameter] = bad;
                let target = Target { force: &measured, first: 0 };
                let rows = misfits(damper, &constant(damper), &theta, &loading, target, None, default())
                    .expect("a batch that runs");
                let name = damper.spec().parameters[parameter].name;
                assert!(!rows[0].squared_error.is_nan());
                assert_eq!(rows[0].squared_error.is_finite(), rows[0].outcome == Outcome::Finished);
                // An infinite steepness or width has a finite force; what is not a number has none.
                if bad.is_nan() {
                    assert_ne!(rows[0].outcome, Outcome::Finished, "{name} of {} is NaN", damper.spec().name);
                }
            }
        }
    }
}

#[test]
fn a_batch_that_was_stopped_says_so() {
    let loading = loading(600);
    let measured = vec![0.0; loading.n_time()];
    for &damper in REGISTRY {
        let theta = batch(damper, 9);
        let settings = Settings { stop: &|| true, ..default() };
        let target = Target { force: &measured, first: 0 };
        assert_eq!(
            misfits(damper, &constant(damper), &theta, &loading, target, None, settings),
            Err(DynamicsError::Cancelled)
        );
        let mut force = vec![0.0; 9 * loading.n_time()];
        let refusal = force_histories(damper, &constant(damper), &theta, &loading, &mut force, settings);
        assert_eq!(refusal, Err(DynamicsError::Cancelled));
    }
}

#[test]
fn a_batch_can_be_stopped_while_it_runs() {
    // Enough work for minutes; were the flag not looked at, the test would not come back.
    let damper = find("normalised_bouc_wen").expect("a registered model");
    let stop = AtomicBool::new(false);
    let loading = loading(20_000);
    let measured = vec![0.0; loading.n_time()];
    let theta = batch(damper, 20_000);
    let stop_requested = || stop.load(Ordering::Relaxed);
    let settings = Settings { stop: &stop_requested, step_factor: 64, ..default() };
    thread::scope(|scope| {
        scope.spawn(|| {
            thread::sleep(Duration::from_millis(30));
            stop.store(true, Ordering::Relaxed);
        });
        let target = Target { force: &measured, first: 0 };
        assert_eq!(
            misfits(damper, &constant(damper), &theta, &loading, target, None, settings),
            Err(DynamicsError::Cancelled)
        );
    });
}

#[test]
fn shapes_that_do_not_fit_are_refused() {
    let loading = loading(50);
    for &damper in REGISTRY {
        let n_params = damper.spec().parameters.len();
        let theta = nominal(damper);
        let measured = vec![0.0; 49];
        let target = Target { force: &measured, first: 0 };
        assert_eq!(
            misfits(damper, &constant(damper), &theta, &loading, target, None, default()),
            Err(DynamicsError::LengthMismatch { name: "force", found: 49, expected: 50 })
        );
        let measured = vec![0.0; 50];
        for first in [50, 60] {
            let target = Target { force: &measured, first };
            let refusal = Err(DynamicsError::EmptyWindow { first, n_time: 50 });
            assert_eq!(
                misfits(damper, &constant(damper), &theta, &loading, target, None, default()),
                refusal
            );
        }
        let mut force = vec![0.0; 50];
        assert_eq!(
            force_histories(damper, &constant(damper), &theta[1..], &loading, &mut force, default()),
            Err(DynamicsError::ParameterCount {
                model: damper.spec().name,
                found: n_params - 1,
                expected: n_params
            })
        );
        for substep_factor in [0, 3, 65, 128, u32::MAX] {
            let settings = Settings { step_factor: substep_factor, ..default() };
            assert_eq!(
                force_histories(damper, &constant(damper), &theta, &loading, &mut force, settings),
                Err(DynamicsError::SubstepFactor { found: substep_factor, most: 64 })
            );
        }
    }
}
