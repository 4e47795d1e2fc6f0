//! The time-stepping rule: classical Runge-Kutta on the grid of the record, with a number of equal sub-steps per sample
//! that follows from the stiffness of the candidate.

use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Motion, Severity, State};
use crate::loading::LoadingHistory;
use crate::parameters::FromSlice;
use crate::real::Real;

/// Most sub-steps per sample interval of a candidate.
///
/// Fits to measured tests at 100 to 1000 Hz take 1 to 64; a candidate far beyond would only delay a search.
pub const MAX_SUBSTEPS: u32 = 256;

/// Largest factor on that number.
pub const MAX_SUBSTEP_FACTOR: u32 = 64;

/// Largest product of step and stiffness bound. Classical Runge-Kutta is stable to 2.78; on measured tests at
/// 1.4 the fit differs from the resolved one by less than 0.01 points, at 2.8 by up to 0.15.
pub(crate) const RESOLUTION: f64 = 1.4;

/// Upper bound of the fastest relaxation rate of the states [1/s] over these commands; not finite if unbounded.
pub(crate) fn stiffness_bound<M: DamperModel>(
    theta: &[f64],
    laws: &CurrentLaws,
    commands: &[f64],
    severity: Severity,
) -> f64 {
    if laws.are_constant() {
        return M::stiffness_bound(&M::Parameters::from_slice(theta), severity);
    }
    let mut bound = 0.0;
    let mut values = vec![f64::NAN; laws.n_params()];
    let mut columns = theta.to_vec();
    laws.prepare(&mut columns);
    for &command in commands {
        laws.evaluate(&columns, command, &mut values);
        let at_command = M::stiffness_bound(&M::Parameters::from_slice(&values), severity);
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
/// The bound is that of the stiffest command of the loading. `None` where the candidate needs more than
/// [`MAX_SUBSTEPS`], or where its bound is not a number.
pub(crate) fn substeps<M: DamperModel>(
    theta: &[f64],
    laws: &CurrentLaws,
    loading: &LoadingHistory,
    factor: u32,
) -> Option<u32> {
    let bound = stiffness_bound::<M>(theta, laws, loading.command_levels(), loading.severity());
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

/// One classical Runge-Kutta step of length `step` [s], parameters and motions given at its start, middle and end.
///
/// The stages are a loop, not four calls: written out, a pack of lanes outgrows the instruction cache.
#[inline(always)]
pub(crate) fn advance<M: DamperModel, R: Real>(
    [p_start, p_middle, p_end]: [&M::Parameters<R>; 3],
    state: M::State<R>,
    [start, middle, end]: [Motion<f64>; 3],
    step: f64,
) -> M::State<R> {
    let (half, sixth, third) = (0.5 * step, step / 6.0, step / 3.0);
    let stages = [
        (p_start, start, half, sixth),
        (p_middle, middle, half, third),
        (p_middle, middle, step, third),
        (p_end, end, 0.0, sixth),
    ];
    let mut at = state;
    let mut next = state;
    for (p, motion, reach, weight) in stages {
        let rate = M::rate(p, at, motion.splat());
        at = state.advance(R::splat(reach), rate);
        next = next.advance(R::splat(weight), rate);
    }
    next
}
