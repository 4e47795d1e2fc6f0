//! Predictive rollout: a few commands, each held for one decision and followed by a base command, are tried on the
//! controller's own model under a forecast of the ground motion; the one of least cost is sent.

use super::law::{Beginning, ControlLaw, Kept};
use super::measurement::Measurement;
use super::rollout::{LEVELS, OTHER_TAILS, Planner};
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::error::DynamicsError;
use crate::lanes::Lanes;

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
                   J = mean_T(sum d^2/D^2 + sum a^2/A^2) + w_p (max(p_d, |d|)^2/D^2 + max(p_a, |a|)^2/A^2) + w_E E(T) + w_R d_p(T)^2\n\
                   a_g(k+1) = sum_m w_m a_g(k+1-m), w by recursive least squares",
        description: "Lowers peak drifts and peak accelerations together. At every decision the base command, and every \
                      level followed by every tail, are tried on the controller's own model of building, dampers and \
                      driver, under a forecast of the ground acceleration, from the state at which the command will \
                      act; d are storey drifts, a absolute floor accelerations, p_d and p_a the largest so far, E twice \
                      the energy of the building at the horizon, d_p the largest drift that a storey which yields then \
                      keeps. The base alone is among the trials, so that in the \
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
                "w_E of q'K q + q''M q' at the horizon, twice the energy, with that of loops",
            ),
            whole("horizon", Unit::Of("s"), "T, from the instant at which the command acts; at most 1 s"),
            whole(
                "force_correction",
                Unit::Of("1"),
                "share of the measured error of the damper force that scales that of the model",
            ),
            whole(
                "residual_weight",
                Unit::Of("1/m2"),
                "w_R of the square of the largest drift that storeys which yield keep at the horizon when they unload",
            ),
        ],
        tables: &["timing", "forecast", "correction", "shears"],
        needs_model: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    type Memory<'a, R: Lanes> = Rollout<'a, R>;

    fn start<R: Lanes>(Beginning { plan, n_devices }: Beginning<'_, R>) -> Self::Memory<'_, R> {
        plan.map_or_else(|| Rollout::Given(vec![R::splat(f64::NAN); n_devices]), Rollout::Planned)
    }

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Self::Memory<'_, R>,
        command: &mut [R],
    ) {
        match memory {
            Rollout::Planned(plan) => plan.command(gains, measured, command),
            Rollout::Given(given) => command.copy_from_slice(given),
        }
    }

    fn check_tables(tables: &[Vec<f64>]) -> Result<(), DynamicsError> {
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
            [time, mass] if positive(time) && positive(mass) => {}
            _ => {
                return refuse(
                    "correction",
                    "2, positive: time [s] over which forces are compared, mass [kg] whose inertia force at A counts",
                );
            }
        }
        match tables[3][..] {
            [offsets, rate, least, most]
                if [offsets, rate].into_iter().all(not_negative)
                    && positive(least)
                    && positive(most)
                    && (least..=most).contains(&1.0) =>
            {
                Ok(())
            }
            _ => refuse(
                "shears",
                "4: 1 for offsets of the shears, else 0, rate at which yield drifts are adapted or 0 [1/s], and their \
                 least and largest factor, from at most 1 to at least 1",
            ),
        }
    }
}

/// What a rollout keeps.
pub(crate) enum Rollout<'a, R: Lanes> {
    /// What plans its commands.
    Planned(Box<Planner<'a, R>>),
    /// Commands that others have planned, of a law under record; not numbers where derivatives are asked for.
    Given(Vec<R>),
}

/// What a planner keeps has loops, and is no list of numbers.
impl<R: Lanes> Kept<R> for Rollout<'_, R> {
    fn each(&mut self, visit: &mut dyn FnMut(&mut R)) {
        if let Self::Given(given) = self {
            given.iter_mut().for_each(visit);
        }
    }
}
