//! Predictive rollout: a few commands, each held for one decision and followed by a base command, are tried on the
//! controller's own model under a forecast of the ground motion; the one of least cost is sent.

mod copy;
mod forecast;
mod planner;
mod prediction;

pub(crate) use planner::{Plan, plan};

use super::loop_model::LoopModel;
use super::{ControlLaw, GainSpec, Gains, LawSpec, Measurement, Memory, Shape, Unit};
use crate::closed_loop::steepest_slopes;
use crate::damper::model::Severity;
use crate::error::DynamicsError;
use crate::lanes::Lanes;

/// Commands that are tried beside the base alone.
const LEVELS: usize = 5;
/// Commands that follow them in the prediction, beside the base.
const OTHER_TAILS: usize = 2;
/// Longest step of the model that is chosen for it [s].
const LONGEST_STEP: f64 = 2.5e-3;
/// Most steps of the model in the time of a decision.
const MOST_STEPS: u32 = 200;
/// Largest product of the step of the model and the largest rate of its equations: classical Runge-Kutta is stable to 2.78.
const STABLE: f64 = 2.5;
/// Most weights of a forecast.
const HIGHEST_ORDER: f64 = 64.0;

/// The best of a few commands on the controller's own model.
pub struct PredictiveRollout;

const fn whole(name: &'static str, unit: Unit, description: &'static str) -> GainSpec {
    GainSpec { name, unit, shape: Shape::Loop, description }
}

impl ControlLaw for PredictiveRollout {
    const SPEC: LawSpec = LawSpec {
        name: "predictive_rollout",
        title: "Predictive rollout",
        equation: "i = argmin_c J_c, c held for a decision and followed by a tail to the horizon T\n\
                   J = mean_T(sum d^2/D^2 + sum a^2/A^2) + w_p (max(p_d, |d|)^2/D^2 + max(p_a, |a|)^2/A^2) + w_E E(T)\n\
                   a_g(k+1) = sum_m w_m a_g(k+1-m), w by recursive least squares",
        description: "Lowers peak drifts and peak accelerations together. At every decision the base command, and every \
                      level followed by every tail, are tried on the controller's own model of building, dampers and \
                      driver, under a forecast of the ground acceleration, from the state at which the command will \
                      act; d are storey drifts, a absolute floor accelerations, p_d and p_a the largest so far, E twice \
                      the energy of the building at the horizon. The base alone is among the trials, so that in the \
                      model no decision costs more than it; ties go to it. Needs a model, a sensor of the ground acceleration and much computation.",
        source: "after Vu, Politopoulos, Diop, Struct. Control Health Monit. 25(1), 2018, e2032; form our own, a rollout",
        gains: &[
            GainSpec {
                name: "base",
                unit: Unit::Command,
                shape: Shape::Device,
                description: "command that is tried alone, held to the horizon; it wins ties, and is a tail",
            },
            GainSpec {
                name: "tails",
                unit: Unit::Command,
                shape: Shape::Numbers(OTHER_TAILS),
                description: "further commands that follow a tried one in the prediction",
            },
            GainSpec {
                name: "levels",
                unit: Unit::Command,
                shape: Shape::Numbers(LEVELS),
                description: "commands that are tried; all devices take the one of the same number",
            },
            whole("drift_weight", Unit::Of("1/m2"), "1/D^2 of the drifts"),
            whole("acceleration_weight", Unit::Of("s4/m2"), "1/A^2 of the absolute accelerations"),
            whole("peak_weight", Unit::Of("1"), "w_p of the peaks over those of the mean squares"),
            whole(
                "energy_weight",
                Unit::Of("1/J"),
                "w_E of q'K q + q''M q' at the horizon, twice the energy",
            ),
            whole("horizon", Unit::Of("s"), "T, from the instant at which the command acts; at most 1 s"),
            whole(
                "force_correction",
                Unit::Of("1"),
                "share of the measured error of the damper force that scales that of the model",
            ),
        ],
        tables: &["timing", "forecast", "correction"],
        memory: 0,
        needs_curve: false,
        needs_model: true,
        commands_force: false,
        reads_acceleration: false,
        takes_signals: false,
    };

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Memory<'_, R>,
        command: &mut [R],
    ) {
        match &mut memory.plan {
            Some(plan) => plan.command(gains, measured, command),
            None => command.fill(R::splat(f64::NAN)),
        }
    }

    fn check_tables(tables: &[Vec<f64>], _: usize) -> Result<(), DynamicsError> {
        let law = Self::SPEC.name;
        let positive = |number: f64| number > 0.0 && number.is_finite();
        let not_negative = |number: f64| number >= 0.0 && number.is_finite();
        let refuse = |table, expected| {
            let found = tables[Self::SPEC.tables.iter().position(|name| *name == table).unwrap_or(0)].len();
            Err(DynamicsError::TableSize { law, table, found, expected })
        };
        match tables[0][..] {
            [hold, step, delay, velocity, acceleration]
                if positive(hold) && [step, delay, velocity, acceleration].into_iter().all(not_negative) => {}
            _ => {
                return refuse(
                    "timing",
                    "5: time of a decision, longest step of the model or 0, delay of the loop [s], and peak rate \
                     [m/s] and its change at reversals [m/s2] of a device",
                );
            }
        }
        match tables[1][..] {
            [order, forgetting, covariance]
                if (0.0..=HIGHEST_ORDER).contains(&order)
                    && order.fract() == 0.0
                    && forgetting > 0.5
                    && forgetting <= 1.0
                    && positive(covariance) => {}
            _ => {
                return refuse(
                    "forecast",
                    "3: order, a whole number up to 64, forgetting, above 0.5, and covariance",
                );
            }
        }
        match tables[2][..] {
            [time, mass] if positive(time) && positive(mass) => Ok(()),
            _ => refuse(
                "correction",
                "2, positive: time [s] over which forces are compared, mass [kg] whose inertia force at A counts",
            ),
        }
    }
}

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
    /// From the tables of the law.
    ///
    /// # Errors
    /// If a decision does not take a whole number of samples, or the step does not resolve the model.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)] // checked before
    pub(crate) fn of(
        tables: &[Vec<f64>],
        model: &LoopModel<'_>,
        ranges: &[[f64; 2]],
        sample_time: f64,
    ) -> Result<Self, DynamicsError> {
        let law = PredictiveRollout::SPEC.name;
        let [hold, given, delay, peak_velocity, reversal_acceleration] = tables[0][..] else {
            return PredictiveRollout::check_tables(tables, 0).and(Err(DynamicsError::NoModel(law)));
        };
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
    const COMMANDS: u32 = 9;
    let (mut decay, mut stiffening, mut states) = (0.0, 0.0, 0.0);
    for (device, (&mass, mounting)) in model.building.device_mass.iter().zip(model.mountings).enumerate() {
        let [smallest, largest] = ranges[device];
        let commands: Vec<f64> = (0..COMMANDS)
            .map(|level| (largest - smallest).mul_add(f64::from(level) / f64::from(COMMANDS - 1), smallest))
            .collect();
        let theta = model.theta_of(device);
        let [over_velocity, over_displacement] = steepest_slopes(model.damper, model.laws, theta, &commands);
        let dampers = mounting.count * if mounting.differential { 2.0 } else { 1.0 };
        decay += dampers * over_velocity / mass;
        stiffening += dampers * over_displacement / mass;
        let own = model.damper.stiffness_bound(theta, model.laws, &commands, severity);
        // A bound that is not a number is kept.
        if own > states || own.is_nan() {
            states = own;
        }
    }
    let of_building = model.building.springs.fastest.hypot(f64::sqrt(stiffening)) + decay;
    if of_building < states || states.is_nan() { states } else { of_building }
}
