//! Parameters that are declared to enter the force only, against the rates of every model.

#![allow(clippy::expect_used, clippy::cast_precision_loss)] // of the batches that tests share, and of small counts

#[allow(dead_code)] // no batch is run
mod batches;

use batches::batch;
use mrwork_dynamics::damper::{Motion, REGISTRY};

const POINTS: usize = 64;

/// The point `index` of a sequence that fills (-1, 1) evenly.
fn spread(index: usize) -> f64 {
    2.0 * (index as f64 * 0.618_033_988_749_894_9).fract() - 1.0
}

#[test]
fn force_only_are_exactly_the_parameters_on_which_no_rate_depends() {
    for damper in REGISTRY.iter().filter(|damper| damper.spec().n_states > 0) {
        let spec = damper.spec();
        let n_params = spec.parameters.len();
        let mut enters_rate = vec![false; n_params];
        for (point, theta) in batch(*damper, POINTS).chunks(n_params).enumerate() {
            let state: Vec<f64> = (0..spec.n_states).map(|entry| spread(3 * point + entry)).collect();
            let motion = Motion { displacement: 0.05 * spread(5 * point), velocity: spread(7 * point + 1) };
            let rate = damper.rate(theta, &state, motion);
            for (index, enters) in enters_rate.iter_mut().enumerate() {
                let mut other = theta.to_vec();
                other[index] *= 1.25;
                *enters |= damper.rate(&other, &state, motion) != rate;
            }
        }
        for (parameter, enters) in spec.parameters.iter().zip(enters_rate) {
            assert_eq!(parameter.force_only, !enters, "{} of {}", parameter.name, spec.name);
        }
    }
}
