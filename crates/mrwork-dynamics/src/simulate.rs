//! Batches of candidates over one loading history, in blocks of lanes on a pool of threads.
//!
//! A candidate's result does not depend on its neighbours, the block it falls into, the number of threads
//! or the instruction set.

use crate::any_damper::Damper;
use crate::block::{Block, Standings};
use crate::current_law::CurrentLaws;
use crate::dispatch::InstructionSet;
use crate::error::{DynamicsError, Outcome};
use crate::loading::LoadingHistory;
use crate::misfit::Target;
use crate::plan::Plan;
use crate::threads::{StopRequested, on_threads};

/// How a batch is to be run.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// Multiplies every candidate's own sub-step count; 1 is the rule, more is for checking it.
    pub substep_factor: u32,
    /// Threads to use, 0 for all.
    pub threads: usize,
    /// Vector instructions to use.
    pub instruction_set: InstructionSet,
    /// Whether the batch is to be given up.
    pub stop: &'a StopRequested<'a>,
}

/// How one candidate fared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Sum of squared residuals [N^2], infinite unless finished; zero where only the force was asked for.
    pub squared_error: f64,
    /// How the simulation ended.
    pub outcome: Outcome,
    /// Sub-steps per sample interval, 0 where not simulated.
    pub substeps: u32,
    /// Steps that were simulated: fewer than the record has where it passed its limit.
    pub steps: u64,
}

/// Misfits of a batch by running reduction: no force is stored.
///
/// `theta` is row-major, shape (batch, `laws.n_columns()`). A sum of squares only grows: a candidate that reaches its
/// limit [N^2], shape (batch,), is abandoned there, and the others close ranks. Whether it is does not depend on where
/// that is noticed.
///
/// # Errors
/// Where shapes do not fit, or the batch was stopped from outside.
pub fn misfits(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    loading: &LoadingHistory,
    target: Target<'_>,
    limits: Option<&[f64]>,
    settings: Settings<'_>,
) -> Result<Vec<Row>, DynamicsError> {
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
    let plan = Plan::new(damper, laws, theta, loading, settings)?;
    let n_batch = plan.rows.len();
    if let Some(limits) = limits
        && limits.len() != n_batch
    {
        return Err(DynamicsError::LimitCount { found: limits.len(), expected: n_batch });
    }
    let whole = core::iter::once(0..loading.n_time()).collect();
    let spans = if limits.is_some() { plan.spans() } else { whole };
    let mut standings = Standings::at_rest(damper.spec(), n_batch, limits);
    let mut rows = plan.rows.clone();
    let mut remaining = plan.order.clone();
    for span in spans {
        let blocks = plan.blocks(&remaining, &span, &standings);
        let reached = on_threads(plan.threads, blocks.iter().collect(), |block: &Block<'_>| {
            damper.squared_errors(settings.instruction_set, block, target)
        })?;
        stopped(settings.stop)?;
        let ran: Vec<Vec<usize>> = blocks.iter().map(|block| block.candidates.to_vec()).collect();
        for (candidates, reached) in ran.iter().zip(reached) {
            for (lane, &candidate) in candidates.iter().enumerate() {
                rows[candidate].steps += reached.samples as u64 * u64::from(rows[candidate].substeps);
                standings.take(candidate, &reached, lane);
            }
        }
        remaining.retain(|&candidate| standings.is_within(candidate));
    }
    for &candidate in &plan.order {
        let row = &mut rows[candidate];
        if standings.is_within(candidate) {
            row.squared_error = standings.sums[candidate];
        } else if standings.limits[candidate] < f64::INFINITY {
            row.outcome = Outcome::Abandoned;
        } else {
            row.outcome = Outcome::Diverged;
        }
    }
    Ok(rows)
}

/// Force histories [N] of a batch, written row by row into `force`, shape (batch, `n_time`).
///
/// A row that did not finish is filled with infinity.
///
/// # Errors
/// Where shapes do not fit, or the batch was stopped from outside.
pub fn force_histories(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    loading: &LoadingHistory,
    force: &mut [f64],
    settings: Settings<'_>,
) -> Result<Vec<Row>, DynamicsError> {
    let plan = Plan::new(damper, laws, theta, loading, settings)?;
    let expected = plan.rows.len() * loading.n_time();
    if force.len() != expected {
        return Err(DynamicsError::LengthMismatch { name: "force", found: force.len(), expected });
    }
    force.fill(f64::INFINITY);
    let standings = Standings::at_rest(damper.spec(), plan.rows.len(), None);
    let blocks = plan.blocks(&plan.order, &(0..loading.n_time()), &standings);
    let mut unclaimed: Vec<Option<&mut [f64]>> = force.chunks_mut(loading.n_time()).map(Some).collect();
    let work: Vec<(&Block<'_>, Vec<&mut [f64]>)> = blocks
        .iter()
        .map(|block| (block, block.candidates.iter().filter_map(|&row| unclaimed[row].take()).collect()))
        .collect();
    on_threads(plan.threads, work, |(block, mut rows)| {
        damper.histories(settings.instruction_set, block, &mut rows);
    })?;
    stopped(settings.stop)?;
    let mut rows = plan.rows.clone();
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
