//! A batch of runs: checked, simulated, and repeated with a shorter step where a damper requires one.

use super::batch::{Batch, n_samples};
use super::history;
use super::reductions::width;
use super::resolution::{addition_of, damper_bound, element_bound, steps_for};
use super::round::{Output, round};
use crate::error::{DynamicsError, Outcome};
use crate::integrate::{MAX_SUBSTEP_FACTOR, MAX_SUBSTEPS};
use crate::settings::Settings;

/// Displacement of a floor [m] beyond which a run counts as diverged: an unstable gain may take long to overflow.
const LARGEST_DISPLACEMENT: f64 = 1e3;

/// Factor on the steps of a run that is not finite or far from resolved, and how often a run that is not finite is tried so
/// with watched dampers; with others, whose bound is known before, once.
const FINER: u32 = 4;
const MOST_TRIES: u32 = 3;

/// Result of one run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunResult {
    /// How it ended.
    pub outcome: Outcome,
    /// Integration steps per control sample, 0 if no admitted number is sufficient.
    pub steps: u32,
}

/// Simulates a batch.
///
/// Summaries are written to `summary`, shape (runs, width of [`super::RUN_QUANTITIES`]), and histories, if requested, to one
/// vector per run, shape (samples of its motion and one for its end, width of [`super::HISTORY_SIGNALS`]). The summary of
/// a run that did not reach its end is infinite.
///
/// # Errors
/// If the arguments do not match, or the batch was cancelled.
pub fn respond(
    batch: &Batch<'_>,
    summary: &mut [f64],
    mut histories: Option<&mut [Vec<f64>]>,
    settings: Settings<'_>,
) -> Result<Vec<RunResult>, DynamicsError> {
    batch.check()?;
    if !(1..=MAX_SUBSTEP_FACTOR).contains(&settings.step_factor) {
        return Err(DynamicsError::StepFactor { found: settings.step_factor, most: MAX_SUBSTEP_FACTOR });
    }
    let width = width(batch.building);
    let expected = batch.runs.len() * width;
    if summary.len() != expected {
        return Err(DynamicsError::MatrixSize { name: "summary", found: summary.len(), expected });
    }
    if let Some(histories) = &histories {
        let samples =
            batch.runs.iter().map(|run| n_samples(&batch.motions[run.motion as usize], batch.hardware));
        let expected = samples.map(|samples| (samples + 1) * history::width(batch.building));
        if !histories.iter().map(Vec::len).eq(expected) {
            let (found, expected) = (histories.len(), batch.runs.len());
            return Err(DynamicsError::MatrixSize { name: "histories", found, expected });
        }
    }
    summary.fill(f64::INFINITY);
    for rows in histories.iter_mut().flat_map(|histories| histories.iter_mut()) {
        rows.fill(f64::INFINITY);
    }
    let additions: Vec<_> = (0..batch.n_draws()).map(|draw| addition_of(batch, draw)).collect();
    let unresolved = RunResult { outcome: Outcome::Unresolved, steps: 0 };
    let mut results = vec![unresolved; batch.runs.len()];
    let mut tries = vec![0; batch.runs.len()];
    let watched = batch.dampers.iter().any(|group| group.damper.is_watched());
    let most_tries = if watched { MOST_TRIES } else { 1 };
    let mut pending: Vec<(usize, u32)> = (0..batch.runs.len())
        .filter_map(|run| {
            let addition = &additions[batch.runs[run].draw as usize];
            let steps = steps_for(batch.hardware, addition.rate_with(batch.springs_of(run)))?;
            Some((run, steps * settings.step_factor))
        })
        .collect();
    let mut output = Output { summary, histories, width };
    while !pending.is_empty() {
        let mut finer = Vec::new();
        for (run, steps, lane) in round(batch, None, &pending, &mut output, settings)? {
            let step = batch.hardware.sample_time / f64::from(steps);
            let draw = batch.runs[run].draw as usize;
            let finite = is_bounded(output.row(run), batch.building.n_floors());
            let wanted = if finite {
                let bound = damper_bound(batch, draw, &lane.severity, &lane.fastest, step);
                let elements =
                    element_bound(batch.building, batch.springs_of(run), &lane.element_severity, step);
                // A bound of the dampers that is not a number is kept.
                let bound = if elements > bound { elements } else { bound };
                let wanted = steps_for(batch.hardware, bound).map(|own| own * settings.step_factor);
                let most = MAX_SUBSTEPS * batch.hardware.steps * settings.step_factor;
                // Far from resolved, the states of a watched damper are not known well enough for a bound.
                let is_far = watched && wanted.is_none_or(|wanted| wanted > FINER * steps);
                if is_far && FINER * steps <= most { Some(FINER * steps) } else { wanted }
            } else if tries[run] == most_tries {
                Some(0)
            } else {
                tries[run] += 1;
                Some(FINER * steps)
            };
            match wanted {
                Some(wanted) if wanted > steps => finer.push((run, wanted)),
                Some(_) => {
                    let outcome = match (finite, lane.command_invalid) {
                        (false, _) => Outcome::Diverged,
                        (true, true) => Outcome::FailedSafe,
                        (true, false) => Outcome::Finished,
                    };
                    results[run] = RunResult { outcome, steps };
                }
                None => output.invalidate_history(run),
            }
            if results[run].outcome == Outcome::Unresolved || !finite {
                output.row(run).fill(f64::INFINITY);
            }
        }
        pending = finer;
    }
    Ok(results)
}

/// Whether a summary, which begins with the peak floor displacements, is finite and within bounds.
fn is_bounded(row: &[f64], n_floors: usize) -> bool {
    let displacements = &row[..n_floors];
    row.iter().all(|value| value.is_finite()) && displacements.iter().all(|&peak| peak < LARGEST_DISPLACEMENT)
}
