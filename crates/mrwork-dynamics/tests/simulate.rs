//! Rows of a batch are independent: of each other, of threads, of instruction sets, of the limits of others.

#![allow(clippy::cast_precision_loss, clippy::expect_used, clippy::float_cmp)] // exact comparison is what is claimed

mod batches;

use batches::{batch, constant, default, forces, loading, settings};
use mrwork_dynamics::damper::REGISTRY;
use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::error::Outcome;
use mrwork_dynamics::misfit::Target;
use mrwork_dynamics::simulate::{CandidateResult, misfits};

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn a_row_of_a_batch_has_the_bits_of_a_call_of_its_own() {
    let loading = loading(300);
    for &damper in REGISTRY {
        let n_params = damper.spec().parameters.len();
        let theta = batch(damper, 70);
        let alone: Vec<(Vec<CandidateResult>, Vec<f64>)> =
            theta.chunks(n_params).map(|row| forces(damper, row, &loading, default())).collect();
        let measured = &alone[0].1;
        let target = Target { force: measured, first: 20 };
        for set in InstructionSet::usable() {
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
            let settings = settings(threads, InstructionSet::detect().expect("a set"));
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
        let steps = |rows: &[CandidateResult]| rows.iter().map(|row| row.steps).sum::<u64>();
        assert!(steps(&limited) < steps(&full), "{} saves nothing", damper.spec().name);
        for threads in [0, 2, 3] {
            for (one, other) in limited.iter().zip(run(Some(&limits), threads)) {
                assert_eq!(
                    CandidateResult { steps: 0, ..*one },
                    CandidateResult { steps: 0, ..other },
                    "{threads} threads"
                );
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
                settings(threads, InstructionSet::detect().expect("a set")),
            )
            .expect("a batch that runs")
        };
        let one = run(1);
        for threads in [0, 2, 3] {
            assert_eq!(run(threads), one, "{} on {threads} threads", damper.spec().name);
        }
    }
}
