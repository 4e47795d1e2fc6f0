//! The number of steps per sample interval: classical Runge-Kutta ([`DamperModel::step`]) on the grid of the record, with
//! equal sub-steps that follow from the stiffness of the candidate.

use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Severity};
use crate::loading::LoadingHistory;
pub use crate::loading::MAX_SUBSTEPS;

/// Largest factor on that number.
pub const MAX_SUBSTEP_FACTOR: u32 = 64;

/// Largest product of step and stiffness bound. Classical Runge-Kutta is stable to 2.78; on measured tests at
/// 1.4 the fit differs from the resolved one by less than 0.01 points, at 2.8 by up to 0.15.
pub(crate) const RESOLUTION: f64 = 1.4;

/// Upper bound of the fastest relaxation rate of the states [1/s] over these commands; not finite if unbounded.
pub(crate) fn stiffness_bound<M: DamperModel>(
    model: M,
    theta: &[f64],
    laws: &CurrentLaws,
    commands: &[f64],
    severity: Severity,
) -> f64 {
    if laws.are_constant() {
        return M::stiffness_bound(&model.parameters(theta), severity);
    }
    let mut bound = 0.0;
    let mut values = vec![f64::NAN; laws.n_params()];
    let mut columns = theta.to_vec();
    laws.prepare(&mut columns);
    for &command in commands {
        laws.evaluate(&columns, command, &mut values);
        let at_command = M::stiffness_bound(&model.parameters(&values), severity);
        // A bound that is not a number is kept.
        if at_command > bound || at_command.is_nan() {
            bound = at_command;
        }
    }
    bound
}

/// Sub-steps per sample interval that resolve this stiffness bound [1/s], not rounded.
pub(crate) fn wanted_substeps(bound: f64, loading: &LoadingHistory) -> f64 {
    loading.dt() * bound / RESOLUTION
}

/// Sub-steps per sample interval (a power of two, so that lanes group), times `factor`.
///
/// The bound is that of the stiffest command of the loading, which may fix the sub-steps instead. `None` where the candidate needs more than
/// [`MAX_SUBSTEPS`], or where its bound is not a number.
pub(crate) fn substeps<M: DamperModel>(
    model: M,
    theta: &[f64],
    laws: &CurrentLaws,
    loading: &LoadingHistory,
    factor: u32,
) -> Option<u32> {
    if let Some(count) = loading.substeps() {
        return Some(count * factor);
    }
    let bound = stiffness_bound(model, theta, laws, loading.command_levels(), loading.severity());
    let wanted = wanted_substeps(bound, loading);
    let mut count = 1;
    while f64::from(count) < wanted {
        count *= 2;
        if count > MAX_SUBSTEPS {
            return None;
        }
    }
    wanted.is_finite().then_some(count * factor)
}
