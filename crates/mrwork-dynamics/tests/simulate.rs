//! Batches: independent rows, named failures, a stop flag, any number of threads.

#![allow(clippy::cast_precision_loss, clippy::expect_used, clippy::float_cmp)]

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use mrwork_dynamics::block::Damper;
use mrwork_dynamics::current_law::CurrentLaws;
use mrwork_dynamics::damper::{REGISTRY, find};
use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::error::{DynamicsError, Outcome};
use mrwork_dynamics::loading::LoadingHistory;
use mrwork_dynamics::misfit::Target;
use mrwork_dynamics::simulate::{Row, Settings, force_histories, misfits};

const fn settings(threads: usize, instruction_set: InstructionSet) -> Settings<'static> {
    Settings { substep_factor: 1, threads, instruction_set, stop: &|| false }
}

fn default() -> Settings<'static> {
    settings(1, InstructionSet::detect())
}

/// A sinusoid of 10 mm at 2.5 Hz.
fn loading(n_time: usize) -> LoadingHistory {
    let omega = 2.0 * std::f64::consts::PI * 2.5;
    let x: Vec<f64> = (0..n_time).map(|i| 0.01 * (omega * i as f64 * 1e-3).sin()).collect();
    LoadingHistory::new(1e-3, &x, None).expect("a valid history")
}

fn constant(damper: &dyn Damper) -> CurrentLaws {
    CurrentLaws::constant(damper.spec())
}

fn nominal(damper: &dyn Damper) -> Vec<f64> {
    damper.spec().parameters.iter().map(|parameter| parameter.nominal).collect()
}

/// Rows around the nominal one: each parameter times a number from 1/2 to 2, so that sub-steps differ.
fn batch(damper: &dyn Damper, n_batch: usize) -> Vec<f64> {
    let nominal = nominal(damper);
    (0..n_batch * nominal.len())
        .map(|i| {
            nominal[i % nominal.len()] * 2f64.powf(2.0 * (i as f64 * 0.618_033_988_749_894_9).fract() - 1.0)
        })
        .collect()
}

fn forces(
    damper: &dyn Damper,
    theta: &[f64],
    loading: &LoadingHistory,
    settings: Settings<'_>,
) -> (Vec<Row>, Vec<f64>) {
    let n_batch = theta.len() / damper.spec().parameters.len();
    let mut force = vec![0.0; n_batch * loading.n_time()];
    let rows = force_histories(damper, &constant(damper), theta, loading, &mut force, settings)
        .expect("a batch that runs");
    (rows, force)
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn supported() -> impl Iterator<Item = InstructionSet> {
    InstructionSet::ALL.into_iter().filter(|set| set.is_supported())
}

#[test]
fn a_row_of_a_batch_has_the_bits_of_a_call_of_its_own() {
    let loading = loading(300);
    for &damper in REGISTRY {
        let n_params = damper.spec().parameters.len();
        let theta = batch(damper, 70);
        let alone: Vec<(Vec<Row>, Vec<f64>)> =
            theta.chunks(n_params).map(|row| forces(damper, row, &loading, default())).collect();
        let measured = &alone[0].1;
        let target = Target { force: measured, first: 20 };
        for set in supported() {
            let (rows, force) = forces(damper, &theta, &loading, settings(2, set));
            let fits = misfits(damper, &constant(damper), &theta, &loading, target, None, settings(2, set))
                .expect("a batch that runs");
            for (i, (single, history)) in alone.iter().enumerate() {
                let name = damper.spec().name;
                assert_eq!(rows[i], single[0], "row {i} of {name} on {}", set.name());
                let row = &force[i * loading.n_time()..(i + 1) * loading.n_time()];
                assert_eq!(bits(row), bits(history), "row {i} of {name} on {}", set.name());
                let theta = &theta[i * n_params..(i + 1) * n_params];
                let fit = misfits(damper, &constant(damper), theta, &loading, target, None, default())
                    .expect("a batch that runs");
                assert_eq!(fits[i].squared_error.to_bits(), fit[0].squared_error.to_bits());
            }
            assert_eq!(fits[0].squared_error, 0.0, "the first row made the measurement");
        }
    }
}

#[test]
fn a_candidate_is_abandoned_where_its_error_reaches_its_limit_and_nowhere_else() {
    let loading = loading(2000);
    for &damper in REGISTRY {
        let theta = batch(damper, 150);
        let measured = vec![100.0; loading.n_time()];
        let target = Target { force: &measured, first: 40 };
        let run = |limits, threads| {
            let settings = settings(threads, InstructionSet::detect());
            misfits(damper, &constant(damper), &theta, &loading, target, limits, settings)
                .expect("a batch that runs")
        };
        let full = run(None, 1);
        // At its own error exactly, at the next number above it, or at the median error.
        let mut errors: Vec<f64> = full.iter().map(|row| row.squared_error).collect();
        errors.sort_by(f64::total_cmp);
        let limits: Vec<f64> = full
            .iter()
            .enumerate()
            .map(|(i, row)| match i % 4 {
                0 => row.squared_error,
                1 => row.squared_error.next_up(),
                _ => errors[errors.len() / 2],
            })
            .collect();
        let limited = run(Some(&limits), 1);
        for ((full, limited), &limit) in full.iter().zip(&limited).zip(&limits) {
            if full.outcome == Outcome::Finished && full.squared_error >= limit {
                let abandoned = (limited.outcome, limited.squared_error);
                assert_eq!(abandoned, (Outcome::Abandoned, f64::INFINITY), "{}", damper.spec().name);
            } else {
                assert_eq!(limited, full, "{}", damper.spec().name);
            }
            assert!(limited.steps <= full.steps);
        }
        let steps = |rows: &[Row]| rows.iter().map(|row| row.steps).sum::<u64>();
        assert!(steps(&limited) < steps(&full), "{} saves nothing", damper.spec().name);
        for threads in [0, 2, 3] {
            for (one, other) in limited.iter().zip(run(Some(&limits), threads)) {
                assert_eq!(Row { steps: 0, ..*one }, Row { steps: 0, ..other }, "{threads} threads");
            }
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let loading = loading(600);
    for &damper in REGISTRY {
        // Above the number of steps at which a second and third thread are woken.
        let theta = batch(damper, 1200);
        let measured = vec![100.0; loading.n_time()];
        let target = Target { force: &measured, first: 0 };
        let run = |threads| {
            misfits(
                damper,
                &constant(damper),
                &theta,
                &loading,
                target,
                None,
                settings(threads, InstructionSet::detect()),
            )
            .expect("a batch that runs")
        };
        let one = run(1);
        for threads in [0, 2, 3] {
            assert_eq!(run(threads), one, "{} on {threads} threads", damper.spec().name);
        }
    }
}

#[test]
fn a_stiff_candidate_is_unresolved_and_not_simulated() {
    let damper = find("normalised_bouc_wen").expect("a registered model");
    let mut theta = nominal(damper);
    theta[4] = 1e9; // rho: yields within a nanometre
    let (rows, force) = forces(damper, &theta, &loading(100), default());
    assert_eq!(
        rows[0],
        Row { squared_error: f64::INFINITY, outcome: Outcome::Unresolved, substeps: 0, steps: 0 }
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
    let settings = Settings { stop: &stop_requested, substep_factor: 64, ..default() };
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
            let settings = Settings { substep_factor, ..default() };
            assert_eq!(
                force_histories(damper, &constant(damper), &theta, &loading, &mut force, settings),
                Err(DynamicsError::SubstepFactor(substep_factor))
            );
        }
    }
}
