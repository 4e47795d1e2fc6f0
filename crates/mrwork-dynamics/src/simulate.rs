//! Batches of candidates over one loading history, in blocks of lanes on a pool of threads.
//!
//! A candidate's result does not depend on its neighbours, the block it falls into, the number of threads
//! or the instruction set.

use crate::block::{Block, Damper};
use crate::current_law::CurrentLaws;
use crate::dispatch::InstructionSet;
use crate::error::{DynamicsError, Outcome};
use crate::integrate::MAX_SUBSTEP_FACTOR;
use crate::lanes::VECTOR_WIDTH;
use crate::loading::{Command, LoadingHistory};
use crate::misfit::Target;
use crate::threads::{StopRequested, on_threads, thread_count};

/// Steps below which waking another thread costs more than it saves.
const STEPS_PER_THREAD: u64 = 60_000;

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
}

/// Misfits of a batch by running reduction: no force is stored.
///
/// `theta` is row-major, shape (batch, `laws.n_columns()`).
///
/// # Errors
/// Where shapes do not fit, or the batch was stopped from outside.
pub fn misfits(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    loading: &LoadingHistory,
    target: Target<'_>,
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
    let blocks = plan.blocks(theta, laws, loading, settings.stop);
    let sums = on_threads(plan.threads, blocks.iter().collect(), |block| {
        damper.squared_errors(settings.instruction_set, block, target)
    })?;
    stopped(settings.stop)?;
    let mut rows = plan.rows.clone();
    for (block, sums) in blocks.iter().zip(sums) {
        for (&candidate, sum) in block.candidates.iter().zip(sums) {
            let row = &mut rows[candidate];
            if sum.is_finite() {
                row.squared_error = sum;
            } else {
                row.outcome = Outcome::Diverged;
            }
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
    let mut plan = Plan::new(damper, laws, theta, loading, settings)?;
    let expected = plan.rows.len() * loading.n_time();
    if force.len() != expected {
        return Err(DynamicsError::LengthMismatch { name: "force", found: force.len(), expected });
    }
    force.fill(f64::INFINITY);
    let blocks = plan.blocks(theta, laws, loading, settings.stop);
    let mut unclaimed: Vec<Option<&mut [f64]>> = force.chunks_mut(loading.n_time()).map(Some).collect();
    let work: Vec<(&Block<'_>, Vec<&mut [f64]>)> = blocks
        .iter()
        .map(|block| (block, block.candidates.iter().filter_map(|&row| unclaimed[row].take()).collect()))
        .collect();
    on_threads(plan.threads, work, |(block, mut rows)| {
        damper.histories(settings.instruction_set, block, &mut rows);
    })?;
    stopped(settings.stop)?;
    for (row, history) in plan.rows.iter_mut().zip(force.chunks_mut(loading.n_time())) {
        if row.outcome == Outcome::Finished {
            if history.iter().all(|sample| sample.is_finite()) {
                row.squared_error = 0.0;
            } else {
                history.fill(f64::INFINITY);
                row.outcome = Outcome::Diverged;
            }
        }
    }
    Ok(plan.rows)
}

/// Candidates in the order in which they run: grouped by sub-steps, the costly ones first.
struct Plan {
    rows: Vec<Row>,
    order: Vec<usize>,
    threads: usize,
    block_width: usize,
}

impl Plan {
    fn new(
        damper: &dyn Damper,
        laws: &CurrentLaws,
        theta: &[f64],
        loading: &LoadingHistory,
        settings: Settings<'_>,
    ) -> Result<Self, DynamicsError> {
        let Settings { substep_factor, threads, instruction_set, .. } = settings;
        if !(substep_factor.is_power_of_two() && substep_factor <= MAX_SUBSTEP_FACTOR) {
            return Err(DynamicsError::SubstepFactor(substep_factor));
        }
        if !laws.are_constant() && matches!(loading.command(), Command::Held(command) if command.is_nan()) {
            return Err(DynamicsError::NoCommand(damper.spec().name));
        }
        let n_columns = laws.n_columns();
        if !theta.len().is_multiple_of(n_columns) {
            return Err(DynamicsError::ParameterCount {
                model: damper.spec().name,
                found: theta.len(),
                expected: n_columns,
            });
        }
        let rows: Vec<Row> = theta
            .chunks_exact(n_columns)
            .map(|theta| {
                let substeps = damper.substeps(theta, laws, loading, substep_factor);
                let outcome = if substeps.is_some() { Outcome::Finished } else { Outcome::Unresolved };
                Row { squared_error: f64::INFINITY, outcome, substeps: substeps.unwrap_or(0) }
            })
            .collect();
        let mut order: Vec<usize> = (0..rows.len()).filter(|&row| rows[row].substeps > 0).collect();
        order.sort_by_key(|&row| core::cmp::Reverse(rows[row].substeps));
        // A batch too small to fill every thread with full blocks is cut into narrower ones.
        let steps: u64 =
            rows.iter().map(|row| u64::from(row.substeps)).sum::<u64>() * loading.n_time() as u64;
        let threads =
            thread_count(threads).min(usize::try_from(steps / STEPS_PER_THREAD).unwrap_or(usize::MAX) + 1);
        let varying = matches!(loading.command(), Command::Varying(_)) && !laws.are_constant();
        let widest = if varying { VECTOR_WIDTH } else { instruction_set.block_width() };
        let share = order.len().div_ceil(threads).next_multiple_of(VECTOR_WIDTH);
        Ok(Self { rows, order, threads, block_width: share.min(widest) })
    }

    fn blocks<'a>(
        &'a self,
        theta: &'a [f64],
        laws: &'a CurrentLaws,
        loading: &'a LoadingHistory,
        stop: &'a StopRequested<'a>,
    ) -> Vec<Block<'a>> {
        self.order
            .chunk_by(|&a, &b| self.rows[a].substeps == self.rows[b].substeps)
            .flat_map(|group| {
                let blocks = group.len().div_ceil(self.block_width);
                group.chunks(group.len().div_ceil(blocks).next_multiple_of(VECTOR_WIDTH))
            })
            .map(|candidates| Block {
                theta,
                laws,
                candidates,
                loading,
                substeps: self.rows[candidates[0]].substeps,
                stop,
            })
            .collect()
    }
}

fn stopped(stop: &StopRequested<'_>) -> Result<(), DynamicsError> {
    if stop() { Err(DynamicsError::Cancelled) } else { Ok(()) }
}
