//! Batches of candidates, their motion, and how they are run: what tests of simulations share.

use mrwork_dynamics::any_damper::Damper;
use mrwork_dynamics::current_law::CurrentLaws;
use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::loading::LoadingHistory;
use mrwork_dynamics::simulate::{CandidateResult, Settings, force_histories};

pub const fn settings(threads: usize, instruction_set: InstructionSet) -> Settings<'static> {
    Settings { step_factor: 1, threads, instruction_set, stop: &|| false }
}

pub fn default() -> Settings<'static> {
    settings(1, InstructionSet::detect().expect("a set"))
}

/// A sinusoid of 10 mm at 2.5 Hz.
pub fn loading(n_time: usize) -> LoadingHistory<'static> {
    let omega = 2.0 * std::f64::consts::PI * 2.5;
    let x: Vec<f64> = (0..n_time).map(|i| 0.01 * (omega * i as f64 * 1e-3).sin()).collect();
    LoadingHistory::new(1e-3, &x, None).expect("a valid history")
}

pub fn constant(damper: &dyn Damper) -> CurrentLaws {
    CurrentLaws::constant(damper.spec())
}

pub fn nominal(damper: &dyn Damper) -> Vec<f64> {
    damper.spec().parameters.iter().map(|parameter| parameter.nominal).collect()
}

/// Rows around the nominal one: each parameter times a number from 1/2 to 2, so that sub-steps differ.
pub fn batch(damper: &dyn Damper, n_batch: usize) -> Vec<f64> {
    let nominal = nominal(damper);
    (0..n_batch * nominal.len())
        .map(|i| {
            nominal[i % nominal.len()] * 2f64.powf(2.0 * (i as f64 * 0.618_033_988_749_894_9).fract() - 1.0)
        })
        .collect()
}

pub fn forces(
    damper: &dyn Damper,
    theta: &[f64],
    loading: &LoadingHistory<'_>,
    settings: Settings<'_>,
) -> (Vec<CandidateResult>, Vec<f64>) {
    let n_batch = theta.len() / damper.spec().parameters.len();
    let mut force = vec![0.0; n_batch * loading.n_time()];
    let rows = force_histories(damper, &constant(damper), theta, loading, &mut force, settings)
        .expect("a batch that runs");
    (rows, force)
}
