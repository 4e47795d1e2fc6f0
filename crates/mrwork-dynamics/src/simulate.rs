//! Batches of candidates over one loading history, in blocks of lanes on a pool of threads.
//!
//! A candidate's result does not depend on its neighbours, the block it falls into, the number of threads
//! or the instruction set.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use crate::damper::{DamperModel, DamperSpec, Motion, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::error::{DynamicsError, Outcome};
use crate::integrate::{MAX_SUBSTEP_FACTOR, advance, substeps};
use crate::lanes::{Lanes, VECTOR_WIDTH};
use crate::loading::LoadingHistory;
use crate::misfit::{History, Sink, SquaredError};
use crate::parameters::FromValues;

/// Steps between two looks at the stop flag and at lost lanes: well below a millisecond apart on a full block.
const STEPS_PER_CHECK: u32 = 512;

/// Steps below which waking another thread costs more than it saves.
const STEPS_PER_THREAD: u64 = 200_000;

/// How a batch is to be run.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Multiplies every candidate's own sub-step count; 1 is the rule, more is for checking it.
    pub substep_factor: u32,
    /// Threads to use, 0 for all.
    pub threads: usize,
    /// Vector instructions to use.
    pub instruction_set: InstructionSet,
    /// Set from outside to give the batch up.
    pub stop: &'a AtomicBool,
}

/// What candidates are compared with.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Measured force [N], one sample per time.
    pub force: &'a [f64],
    /// First sample that counts; those before it are simulated only.
    pub first: usize,
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

/// Candidates that share a sub-step count and run side by side.
pub struct Block<'a> {
    theta: &'a [f64],
    candidates: &'a [usize],
    loading: &'a LoadingHistory,
    substeps: u32,
    stop: &'a AtomicBool,
}

/// A damper model behind a pointer: whole blocks and single evaluations, nothing inside a time step.
pub trait Damper: Sync {
    /// What the model says of itself.
    fn spec(&self) -> &'static DamperSpec;
    /// Sub-steps per sample interval, `None` where the candidate cannot be resolved.
    fn substeps(&self, theta: &[f64], loading: &LoadingHistory, factor: u32) -> Option<u32>;
    /// Time derivative of the states.
    fn rate(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> Vec<f64>;
    /// Force [N].
    fn force(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> f64;
    /// Arithmetic operations of one step and one residual, a fused multiply-add counted as two.
    fn flops_per_step(&self, theta: &[f64]) -> u64;
    /// Sums of squared residuals against a measured force, one per candidate of the block.
    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> Vec<f64>;
    /// Force histories, one row per candidate of the block.
    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]);
}

impl<M: DamperModel> Damper for M {
    fn spec(&self) -> &'static DamperSpec {
        const { &M::SPEC }
    }

    fn substeps(&self, theta: &[f64], loading: &LoadingHistory, factor: u32) -> Option<u32> {
        substeps::<M>(theta, loading.dt(), loading.severity(), factor)
    }

    fn rate(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> Vec<f64> {
        let (p, state) = at_point::<M>(theta, state);
        let mut rate = Vec::with_capacity(M::SPEC.n_states);
        M::rate(&p, state, motion).for_each(|_, value| rate.push(value));
        rate
    }

    fn force(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> f64 {
        let (p, state) = at_point::<M>(theta, state);
        M::force(&p, state, motion)
    }

    fn flops_per_step(&self, theta: &[f64]) -> u64 {
        crate::peak::flops_per_step::<M>(theta)
    }

    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> Vec<f64> {
        set.run(
            block.candidates.len(),
            SquaredErrorJob::<M> { block, target, model: core::marker::PhantomData },
        )
    }

    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]) {
        set.run(block.candidates.len(), HistoryJob::<M> { block, rows, model: core::marker::PhantomData });
    }
}

fn at_point<M: DamperModel>(theta: &[f64], state: &[f64]) -> (M::Parameters<f64>, M::State<f64>) {
    let entry = |values: &[f64], index: usize| values.get(index).copied().unwrap_or(f64::NAN);
    (M::Parameters::from_values(|index| entry(theta, index)), M::State::from_fn(|index| entry(state, index)))
}

struct SquaredErrorJob<'a, M> {
    block: &'a Block<'a>,
    target: Target<'a>,
    model: core::marker::PhantomData<M>,
}

impl<M: DamperModel> LaneJob for SquaredErrorJob<'_, M> {
    type Output = Vec<f64>;
    #[inline(always)]
    fn run<R: Lanes>(self) -> Vec<f64> {
        let mut sink =
            SquaredError { measured: self.target.force, first: self.target.first, sum: R::splat(0.0) };
        run_block::<M, R, _>(self.block, &mut sink);
        let mut sums = Vec::with_capacity(R::WIDTH);
        sink.sum.for_each(|_, sum| sums.push(sum));
        sums.truncate(self.block.candidates.len());
        sums
    }
}

struct HistoryJob<'a, 'b, M> {
    block: &'a Block<'a>,
    rows: &'a mut [&'b mut [f64]],
    model: core::marker::PhantomData<M>,
}

impl<M: DamperModel> LaneJob for HistoryJob<'_, '_, M> {
    type Output = ();
    #[inline(always)]
    fn run<R: Lanes>(self) {
        run_block::<M, R, _>(self.block, &mut History { rows: self.rows });
    }
}

/// Simulates one block from rest. Lanes without a candidate repeat the last one.
#[inline(always)]
fn run_block<M: DamperModel, R: Lanes, S: Sink<R>>(block: &Block<'_>, sink: &mut S) {
    let Block { theta, candidates, loading, substeps, stop } = *block;
    let n_params = M::SPEC.parameters.len();
    let last = candidates.len() - 1;
    let p = M::Parameters::<R>::from_values(|index| {
        R::from_fn(|lane| theta[candidates[lane.min(last)] * n_params + index])
    });
    let fraction = 1.0 / f64::from(substeps);
    let step = loading.dt() * fraction;
    let check_every = (STEPS_PER_CHECK / substeps).max(1) as usize;
    let mut state = M::State::<R>::rest();
    for (sample, interval) in loading.intervals().iter().enumerate() {
        // Before the first sample too: the blocks that a stopped batch has left return at once.
        if sample % check_every == 0 && (stop.load(Ordering::Relaxed) || sink.is_lost()) {
            return;
        }
        let mut start = interval.motion(0.0);
        sink.take(sample, M::force(&p, state, start.splat()));
        if M::SPEC.n_states > 0 {
            for substep in 0..substeps {
                let u = f64::from(substep) * fraction;
                let middle = interval.motion(u + 0.5 * fraction);
                let end = interval.motion(u + fraction);
                state = advance::<M, R>(&p, state, [start, middle, end], step);
                start = end;
            }
        }
    }
    sink.take(loading.n_time() - 1, M::force(&p, state, loading.last().splat()));
}

/// Misfits of a batch by running reduction: no force is stored.
///
/// `theta` is row-major, shape (batch, `n_params`).
///
/// # Errors
/// Where shapes do not fit, or the batch was stopped from outside.
pub fn misfits(
    damper: &dyn Damper,
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
    let plan = Plan::new(damper, theta, loading, settings)?;
    let blocks = plan.blocks(theta, loading, settings.stop);
    let sums = on_threads(plan.threads, || {
        blocks
            .par_iter()
            .map(|block| damper.squared_errors(settings.instruction_set, block, target))
            .collect::<Vec<_>>()
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
    theta: &[f64],
    loading: &LoadingHistory,
    force: &mut [f64],
    settings: Settings<'_>,
) -> Result<Vec<Row>, DynamicsError> {
    let mut plan = Plan::new(damper, theta, loading, settings)?;
    let expected = plan.rows.len() * loading.n_time();
    if force.len() != expected {
        return Err(DynamicsError::LengthMismatch { name: "force", found: force.len(), expected });
    }
    force.fill(f64::INFINITY);
    let blocks = plan.blocks(theta, loading, settings.stop);
    let mut unclaimed: Vec<Option<&mut [f64]>> = force.chunks_mut(loading.n_time()).map(Some).collect();
    let work: Vec<(&Block<'_>, Vec<&mut [f64]>)> = blocks
        .iter()
        .map(|block| (block, block.candidates.iter().filter_map(|&row| unclaimed[row].take()).collect()))
        .collect();
    on_threads(plan.threads, || {
        work.into_par_iter().for_each(|(block, mut rows)| {
            damper.histories(settings.instruction_set, block, &mut rows);
        });
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
        theta: &[f64],
        loading: &LoadingHistory,
        settings: Settings<'_>,
    ) -> Result<Self, DynamicsError> {
        let Settings { substep_factor, threads, instruction_set, .. } = settings;
        if !(substep_factor.is_power_of_two() && substep_factor <= MAX_SUBSTEP_FACTOR) {
            return Err(DynamicsError::SubstepFactor(substep_factor));
        }
        let n_params = damper.spec().parameters.len();
        if !theta.len().is_multiple_of(n_params) {
            return Err(DynamicsError::ParameterCount {
                model: damper.spec().name,
                found: theta.len(),
                expected: n_params,
            });
        }
        let rows: Vec<Row> = theta
            .chunks_exact(n_params)
            .map(|theta| {
                let substeps = damper.substeps(theta, loading, substep_factor);
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
        let share = order.len().div_ceil(threads).next_multiple_of(VECTOR_WIDTH);
        Ok(Self { rows, order, threads, block_width: share.min(instruction_set.block_width()) })
    }

    fn blocks<'a>(
        &'a self,
        theta: &'a [f64],
        loading: &'a LoadingHistory,
        stop: &'a AtomicBool,
    ) -> Vec<Block<'a>> {
        self.order
            .chunk_by(|&a, &b| self.rows[a].substeps == self.rows[b].substeps)
            .flat_map(|group| group.chunks(self.block_width))
            .map(|candidates| Block {
                theta,
                candidates,
                loading,
                substeps: self.rows[candidates[0]].substeps,
                stop,
            })
            .collect()
    }
}

fn stopped(stop: &AtomicBool) -> Result<(), DynamicsError> {
    if stop.load(Ordering::Relaxed) { Err(DynamicsError::Cancelled) } else { Ok(()) }
}

fn thread_count(threads: usize) -> usize {
    if threads > 0 { threads } else { std::thread::available_parallelism().map_or(1, usize::from) }
}

/// Runs `work` on the pool of that many threads; pools are started once and kept.
pub(crate) fn on_threads<T: Send>(
    threads: usize,
    work: impl FnOnce() -> T + Send,
) -> Result<T, DynamicsError> {
    static POOLS: Mutex<BTreeMap<usize, Arc<rayon::ThreadPool>>> = Mutex::new(BTreeMap::new());
    let count = thread_count(threads);
    let pool = {
        let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pool) = pools.get(&count) {
            Arc::clone(pool)
        } else {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(count)
                .build()
                .map_err(|error| DynamicsError::Threads(error.to_string()))?;
            let pool = Arc::new(pool);
            pools.insert(count, Arc::clone(&pool));
            pool
        }
    };
    Ok(pool.install(work))
}
