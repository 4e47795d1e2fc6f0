//! Derivatives of the summaries of runs along directions of the gains, by dual numbers: those of the loop as it is computed,
//! steps and samples as they are.

use super::batch::Batch;
use super::directions::Directions;
use super::respond::{RunResult, respond};
use super::round::{Output, round};
use crate::dual_block::TANGENTS;
use crate::error::{DynamicsError, Outcome};
use crate::settings::Settings;

/// Simulates a batch as [`respond`] does, and writes the derivatives of its summaries to `slopes`, shape (runs, directions,
/// columns of a summary); they are not a number for runs that did not reach their end.
///
/// # Errors
/// As [`respond`], and if the law switches or the directions do not match the candidates.
pub fn respond_with_slopes(
    batch: &Batch<'_>,
    directions: Directions<'_>,
    summary: &mut [f64],
    slopes: &mut [f64],
    settings: Settings<'_>,
) -> Result<Vec<RunResult>, DynamicsError> {
    if batch.law.spec().switches {
        return Err(DynamicsError::Switches(batch.law.spec().name));
    }
    let results = respond(batch, summary, None, settings)?;
    let n_gains = batch.law.spec().n_gains(batch.sizes());
    let candidates = batch.gains.len().checked_div(n_gains).unwrap_or(0);
    let expected = candidates * directions.count * n_gains;
    if directions.changes.len() != expected {
        let found = directions.changes.len();
        return Err(DynamicsError::MatrixSize { name: "changes", found, expected });
    }
    let expected = summary.len() * directions.count;
    if slopes.len() != expected {
        return Err(DynamicsError::MatrixSize { name: "slopes", found: slopes.len(), expected });
    }
    slopes.fill(f64::NAN);
    let width = summary.len().checked_div(batch.runs.len()).unwrap_or(0);
    let groups = directions.groups();
    let runs: Vec<_> = batch.runs.iter().flat_map(|&run| core::iter::repeat_n(run, groups)).collect();
    let pending: Vec<(usize, u32)> = (0..runs.len())
        .map(|run| (run, results[run / groups]))
        .filter(|(_, result)| matches!(result.outcome, Outcome::Finished | Outcome::FailedSafe))
        .map(|(run, result)| (run, result.steps))
        .collect();
    let repeated = Batch { runs: &runs, ..batch.clone() };
    let mut values = vec![0.0; runs.len() * width];
    let mut output = Output { summary: &mut values, histories: None, width };
    for (run, _, lane) in round(&repeated, Some(directions), &pending, &mut output, settings)? {
        let first = run % groups * TANGENTS;
        let count = TANGENTS.min(directions.count - first);
        let row = (run / groups * directions.count + first) * width;
        slopes[row..][..count * width].copy_from_slice(&lane.slopes[..count * width]);
    }
    Ok(results)
}
