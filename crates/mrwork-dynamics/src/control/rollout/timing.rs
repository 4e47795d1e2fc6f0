//! Instants of a rollout, and the step that resolves the controller's model.

use crate::control::loop_model::LoopModel;
use crate::coupled::{added_rates, relaxation_bound};
use crate::damper::model::Severity;
use crate::error::DynamicsError;

/// Longest step of the model that is chosen for it [s].
const LONGEST_STEP: f64 = 2.5e-3;
/// Most steps of the model in the time of a decision.
const MOST_STEPS: u32 = 200;
/// Largest product of the step of the model and the largest rate of its equations: classical Runge-Kutta is stable to 2.78.
const STABLE: f64 = 2.5;
/// Instants of a rollout.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timing {
    /// Time of a decision [s].
    pub(super) hold: f64,
    /// The same in control samples.
    pub(super) samples: usize,
    /// Steps of the model in it.
    pub(super) steps: u32,
    /// Time from a measurement until its command acts: whole samples, and the rest [s].
    pub(super) delay_samples: usize,
    pub(super) delay_rest: f64,
    pub(super) sample_time: f64,
}

impl Timing {
    /// From time of a decision, longest step of the model or 0, delay of the loop [s], and peak rate [m/s] and its change at
    /// reversals [m/s2] of a device.
    ///
    /// # Errors
    /// If a decision does not take a whole number of samples, or the step does not resolve the model.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)] // checked before
    pub(crate) fn of(
        law: &'static str,
        numbers: [f64; 5],
        model: &LoopModel<'_>,
        ranges: &[[f64; 2]],
        sample_time: f64,
    ) -> Result<Self, DynamicsError> {
        let [hold, given, delay, peak_velocity, reversal_acceleration] = numbers;
        let samples = (hold / sample_time).round();
        if samples < 1.0 || (samples * sample_time - hold).abs() > 1e-6 * sample_time {
            return Err(DynamicsError::Decision { law, hold, sample_time });
        }
        let bound = largest_rate(model, ranges, Severity { peak_velocity, reversal_acceleration });
        let longest = if given > 0.0 { given } else { LONGEST_STEP.min(STABLE / bound) };
        let steps = (hold / longest * (1.0 - 1e-9)).ceil().max(1.0);
        let is_resolved = steps <= f64::from(MOST_STEPS) && hold / steps * bound <= STABLE;
        if !is_resolved {
            return Err(DynamicsError::ModelStep {
                law,
                step: hold / steps,
                needed: STABLE / bound,
                shortest: hold / f64::from(MOST_STEPS),
            });
        }
        let delay_samples = (delay / sample_time * (1.0 + 1e-9)).floor();
        let rest = delay - delay_samples * sample_time;
        Ok(Self {
            hold,
            samples: samples as usize,
            steps: steps as u32,
            delay_samples: delay_samples as usize,
            delay_rest: if rest > 1e-9 * sample_time { rest } else { 0.0 },
            sample_time,
        })
    }

    /// Length of a step of the model [s].
    pub(super) fn step(&self) -> f64 {
        self.hold / f64::from(self.steps)
    }
}

/// Largest rate of the equations of the model [1/s].
fn largest_rate(model: &LoopModel<'_>, ranges: &[[f64; 2]], severity: Severity) -> f64 {
    let (stiffening, decay) = added_rates(&model.dampers, 0, ranges, &model.building.device_mass);
    // Loops of elements are held to their ends where a step is long for them.
    let elements = model.building.element_parameters.iter().zip(&model.building.element_mass);
    let stiffening =
        elements.fold(stiffening, |sum, (each, mass)| sum + each.yield_force * each.slope / mass);
    let states = relaxation_bound(&model.dampers, 0, ranges, |_| severity);
    let of_building = model.building.springs.fastest.hypot(f64::sqrt(stiffening)) + decay;
    if of_building < states || states.is_nan() { states } else { of_building }
}
