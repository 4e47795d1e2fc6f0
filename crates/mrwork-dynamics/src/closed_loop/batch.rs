//! A batch of runs: checked, cut into blocks of lanes, run again more finely where a damper turns out to need it.

use super::hardware::{Hardware, Observer};
use super::reductions::layout;
use super::resolution::{building_bound, damper_bound, steps_for};
use super::round::Out;
use crate::any_damper::Damper;
use crate::building::Building;
use crate::control::{CurveModel, Law, Place};
use crate::current_law::CurrentLaws;
use crate::dispatch::InstructionSet;
use crate::error::{DynamicsError, Outcome};
use crate::ground_motion::GroundMotion;
use crate::integrate::MAX_SUBSTEP_FACTOR;
use crate::threads::StopRequested;

/// Displacement of a floor [m] beyond which a run counts as diverged: an unstable gain may take long to leave the finite
/// numbers.
const RUN_AWAY: f64 = 1e3;

/// A candidate's gains under a motion, with a draw of the dampers.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Row of the gains.
    pub candidate: u32,
    /// Index of the motion.
    pub motion: u32,
    /// Row of the damper parameters.
    pub draw: u32,
    /// Stream of the sensors' noise; runs of the same stream have the same noise.
    pub stream: u64,
}

/// Everything that the runs share.
#[derive(Clone)]
pub struct Batch<'a> {
    /// The building, with the devices' places.
    pub building: &'a Building,
    /// The model of all devices.
    pub damper: &'a dyn Damper,
    /// How its parameters follow the command.
    pub laws: &'a CurrentLaws,
    /// Damper parameters, shape (draws, devices, columns).
    pub theta: &'a [f64],
    /// How dampers sit in each device.
    pub places: &'a [Place],
    /// Smallest and largest command of each device.
    pub ranges: &'a [[f64; 2]],
    /// The control law.
    pub law: Law,
    /// Its gains, shape (candidates, gains).
    pub gains: &'a [f64],
    /// Its tables.
    pub tables: &'a [Vec<f64>],
    /// What it believes of the dampers.
    pub curve: Option<CurveModel<'a>>,
    /// The ground motions.
    pub motions: &'a [GroundMotion],
    /// The runs.
    pub runs: &'a [Run],
    /// What stands between building and coil.
    pub hardware: &'a Hardware,
    /// What estimates the state; without one the law sees it as it is.
    pub observer: Option<&'a Observer>,
}

/// How a batch is to be run.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// Multiplies every run's own step count; 1 is the rule, more is for checking it.
    pub step_factor: u32,
    /// Threads to use, 0 for all.
    pub threads: usize,
    /// Vector instructions to use.
    pub instruction_set: InstructionSet,
    /// Whether the batch is to be given up.
    pub stop: &'a StopRequested<'a>,
}

/// How a run fared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunResult {
    /// How it ended.
    pub outcome: Outcome,
    /// Integration steps per control sample, 0 where none was fine enough.
    pub steps: u32,
}

/// Control samples of a motion.
#[must_use]
pub fn n_samples(motion: &GroundMotion, hardware: &Hardware) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a duration is positive
    let samples = (motion.duration() / hardware.sample_time * (1.0 + 1e-12)).floor() as usize;
    samples.max(1)
}

/// Runs a batch. Summaries go into `summary`, shape (runs, width of [`layout`]); histories, where asked for, into one
/// slice per run, shape (samples of its motion, width of [`super::history_layout`]).
///
/// A run that did not reach its end has infinity in its summary.
///
/// # Errors
/// Where something does not fit together, or the batch was stopped from outside.
pub fn respond(
    batch: &Batch<'_>,
    summary: &mut [f64],
    mut histories: Option<&mut [Vec<f64>]>,
    settings: Settings<'_>,
) -> Result<Vec<RunResult>, DynamicsError> {
    batch.check()?;
    if !(1..=MAX_SUBSTEP_FACTOR).contains(&settings.step_factor) {
        return Err(DynamicsError::StepFactor(settings.step_factor));
    }
    let width: usize = layout(batch.building).iter().map(|&(_, count)| count).sum();
    let expected = batch.runs.len() * width;
    if summary.len() != expected {
        return Err(DynamicsError::MatrixSize { name: "summary", found: summary.len(), expected });
    }
    summary.fill(f64::INFINITY);
    for rows in histories.iter_mut().flat_map(|histories| histories.iter_mut()) {
        rows.fill(f64::INFINITY);
    }
    let first_steps = batch.first_steps();
    let unresolved = RunResult { outcome: Outcome::Unresolved, steps: 0 };
    let mut results = vec![unresolved; batch.runs.len()];
    let mut tried_finer = vec![false; batch.runs.len()];
    let mut pending: Vec<(usize, u32)> = (0..batch.runs.len())
        .filter_map(|run| {
            let steps = first_steps[batch.runs[run].draw as usize]?;
            Some((run, steps * settings.step_factor))
        })
        .collect();
    let mut out = Out { summary, histories, width };
    while !pending.is_empty() {
        let mut finer = Vec::new();
        for (run, steps, left) in batch.round(&pending, &mut out, settings)? {
            let step = batch.hardware.sample_time / f64::from(steps);
            let draw = batch.runs[run].draw as usize;
            let finite = batch.is_bounded(out.row(run));
            let wanted = if finite {
                let own = steps_for(batch, damper_bound(batch, draw, &left.severity, step));
                own.map(|own| own * settings.step_factor)
            } else if tried_finer[run] {
                Some(0)
            } else {
                tried_finer[run] = true;
                Some(steps * 4)
            };
            match wanted {
                Some(wanted) if wanted > steps => finer.push((run, wanted)),
                Some(_) => {
                    let outcome = match (finite, left.at_a_loss) {
                        (false, _) => Outcome::Diverged,
                        (true, true) => Outcome::FailedSafe,
                        (true, false) => Outcome::Finished,
                    };
                    results[run] = RunResult { outcome, steps };
                }
                None => out.forget_history(run),
            }
            if results[run].outcome == Outcome::Unresolved || !finite {
                out.row(run).fill(f64::INFINITY);
            }
        }
        pending = finer;
    }
    Ok(results)
}

impl<'a> Batch<'a> {
    /// Damper parameters of a device in a draw.
    pub(super) fn theta_of(&self, draw: usize, device: usize) -> &'a [f64] {
        let n_columns = self.laws.n_columns();
        &self.theta[(draw * self.places.len() + device) * n_columns..][..n_columns]
    }

    /// Whether a summary is that of a building that still stands somewhere.
    fn is_bounded(&self, row: &[f64]) -> bool {
        let displacements = &row[..self.building.n_floors()];
        row.iter().all(|value| value.is_finite()) && displacements.iter().all(|&peak| peak < RUN_AWAY)
    }

    /// Steps per sample for each draw, before anything is known of the motion; `None` where none is fine enough.
    fn first_steps(&self) -> Vec<Option<u32>> {
        let n_draws = self.theta.len() / (self.places.len() * self.laws.n_columns()).max(1);
        (0..n_draws.max(1)).map(|draw| steps_for(self, building_bound(self, draw))).collect()
    }
}
