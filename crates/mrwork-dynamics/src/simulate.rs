//! Batches of candidates under one loading history, in blocks of lanes on a pool of threads.
//!
//! The result of a candidate does not depend on its neighbours, its block, the number of threads or the instruction set.

use crate::any_damper::Damper;
use crate::block::{BatchProgress, Block};
use crate::current_law::CurrentLaws;
use crate::error::{DynamicsError, Outcome};
use crate::integrate;
use crate::loading::LoadingHistory;
use crate::misfit::Target;
pub use crate::schedule::CandidateResult;
use crate::schedule::{Schedule, Watched};
pub use crate::settings::Settings;
use crate::threads::{StopRequested, on_threads};

/// Stiffness of each candidate, as a share of the largest that is simulated at the step of this loading.
///
/// Above 1 a candidate wants more than [`integrate::MAX_SUBSTEPS`]. `theta` is row-major, shape (batch,
/// `laws.n_columns()`). A model that is watched is simulated for it.
///
/// # Errors
/// If the batch was cancelled.
pub fn stiffness_shares(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    loading: &LoadingHistory,
    settings: Settings<'_>,
) -> Result<Vec<f64>, DynamicsError> {
    let wanted: Vec<f64> = if damper.is_watched() {
        let watched = Watched::over(damper, laws, theta, loading, settings)?;
        watched.iter().map(|row| row.wanted).collect()
    } else {
        theta
            .chunks_exact(laws.n_columns())
            .map(|theta| damper.stiffness_bound(theta, laws, loading.command_levels(), loading.severity()))
            .map(|bound| integrate::wanted_substeps(bound, loading))
            .collect()
    };
    Ok(wanted.into_iter().map(|wanted| wanted / f64::from(integrate::MAX_SUBSTEPS)).collect())
}

/// Misfits of a batch by running reduction: no force is stored.
///
/// `theta` is row-major, shape (batch, `laws.n_columns()`). A candidate whose sum reaches its limit [N^2], shape (batch,),
/// is abandoned, and the remaining candidates are regrouped. A sum never decreases, so the outcome does not depend on when
/// the limit is checked.
///
/// # Errors
/// If shapes do not match, or the batch was cancelled.
pub fn misfits(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    loading: &LoadingHistory,
    target: Target<'_>,
    limits: Option<&[f64]>,
    settings: Settings<'_>,
) -> Result<Vec<CandidateResult>, DynamicsError> {
    if target.force.len() != loading.n_time() {
        return Err(DynamicsError::LengthMismatch {
            name: "force",
            found: target.force.len(),
            expected: loading.n_time(),
        });
    }
    if target.first >= loading.n_time() {
        return Err(DynamicsError::EmptyWindow { first: target.first, n_time: loading.n_time() });
    }
    let schedule = Schedule::new(damper, laws, theta, loading, settings)?;
    let n_batch = schedule.rows.len();
    if let Some(limits) = limits
        && limits.len() != n_batch
    {
        return Err(DynamicsError::LimitCount { found: limits.len(), expected: n_batch });
    }
    let whole = core::iter::once(0..loading.n_time()).collect();
    let spans = if limits.is_some() { schedule.spans() } else { whole };
    let mut progress = BatchProgress::at_rest(damper.spec(), n_batch, limits);
    let mut rows = schedule.rows.clone();
    let mut remaining = schedule.order.clone();
    for span in spans {
        let blocks = schedule.blocks(&remaining, &span, &progress);
        let results = on_threads(schedule.threads, blocks.iter().collect(), |block: &Block<'_>| {
            damper.squared_errors(settings.instruction_set, block, target)
        })?;
        stopped(settings.stop)?;
        let ran: Vec<Vec<usize>> = blocks.iter().map(|block| block.candidates.to_vec()).collect();
        for (candidates, result) in ran.iter().zip(results) {
            for (lane, &candidate) in candidates.iter().enumerate() {
                rows[candidate].steps += result.samples as u64 * u64::from(rows[candidate].substeps);
                progress.take(candidate, &result, lane);
            }
        }
        remaining.retain(|&candidate| progress.is_within(candidate));
    }
    for &candidate in &schedule.order {
        let row = &mut rows[candidate];
        if progress.is_within(candidate) {
            row.squared_error = progress.sums[candidate];
        } else if progress.limits[candidate] < f64::INFINITY {
            row.outcome = Outcome::Abandoned;
        } else {
            row.outcome = Outcome::Diverged;
        }
    }
    Ok(rows)
}

/// Force histories [N] of a batch, written row by row into `force`, shape (batch, `n_time`).
///
/// A row that did not finish is infinite.
///
/// # Errors
/// If shapes do not match, or the batch was cancelled.
pub fn force_histories(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    loading: &LoadingHistory,
    force: &mut [f64],
    settings: Settings<'_>,
) -> Result<Vec<CandidateResult>, DynamicsError> {
    let schedule = Schedule::new(damper, laws, theta, loading, settings)?;
    let expected = schedule.rows.len() * loading.n_time();
    if force.len() != expected {
        return Err(DynamicsError::LengthMismatch { name: "force", found: force.len(), expected });
    }
    force.fill(f64::INFINITY);
    let progress = BatchProgress::at_rest(damper.spec(), schedule.rows.len(), None);
    let blocks = schedule.blocks(&schedule.order, &(0..loading.n_time()), &progress);
    let mut unclaimed: Vec<Option<&mut [f64]>> = force.chunks_mut(loading.n_time()).map(Some).collect();
    let work: Vec<(&Block<'_>, Vec<&mut [f64]>)> = blocks
        .iter()
        .map(|block| (block, block.candidates.iter().filter_map(|&row| unclaimed[row].take()).collect()))
        .collect();
    on_threads(schedule.threads, work, |(block, mut rows)| {
        damper.histories(settings.instruction_set, block, &mut rows);
    })?;
    stopped(settings.stop)?;
    let mut rows = schedule.rows.clone();
    for (row, history) in rows.iter_mut().zip(force.chunks_mut(loading.n_time())) {
        if row.outcome == Outcome::Finished {
            if history.iter().all(|sample| sample.is_finite()) {
                row.squared_error = 0.0;
                row.steps = loading.n_time() as u64 * u64::from(row.substeps);
            } else {
                history.fill(f64::INFINITY);
                row.outcome = Outcome::Diverged;
            }
        }
    }
    Ok(rows)
}

pub(crate) fn stopped(stop: &StopRequested<'_>) -> Result<(), DynamicsError> {
    if stop() { Err(DynamicsError::Cancelled) } else { Ok(()) }
}
