//! Schedule of a batch: candidates grouped by sub-steps and cut into blocks of lanes and spans of the record.

use core::ops::Range;

use crate::any_damper::Damper;
use crate::block::{BatchProgress, Block};
use crate::current_law::CurrentLaws;
use crate::error::{DynamicsError, Outcome};
use crate::integrate::{MAX_SUBSTEP_FACTOR, MAX_SUBSTEPS, RESOLUTION};
use crate::lanes::VECTOR_WIDTH;
use crate::loading::{Command, LoadingHistory};
use crate::settings::Settings;
use crate::threads::{on_threads, thread_count};

/// Fewest steps per thread: below, starting another thread costs more than it saves.
const STEPS_PER_THREAD: u64 = 36_000;
/// Short steps that take as long as one of the others.
const SHORT_STEPS: u64 = 6;
/// Fewest steps per thread and span: below, regrouping the remaining candidates costs more than it saves.
const STEPS_PER_SPAN: u64 = 20_000;
/// Factor on the sub-steps of a run that is not finite.
const FINER: u32 = 4;
/// Most spans of a record.
const MOST_SPANS: u64 = 16;

/// Of `threads`, 0 for all, those that are worth starting for a batch of that many steps.
fn worthwhile_threads(threads: usize, steps: u64) -> usize {
    thread_count(threads)
        .min(usize::try_from(steps / STEPS_PER_THREAD).unwrap_or(usize::MAX).saturating_add(1))
}

/// Sub-steps of a candidate whose model has no bound of its stiffness before the motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watched {
    /// Sub-steps that resolve the candidate, not rounded; infinite where no number does.
    pub(crate) wanted: f64,
    /// Those that it gets, a power of two; `None` where it needs more than [`MAX_SUBSTEPS`].
    pub(crate) substeps: Option<u32>,
}

impl Watched {
    /// Of each candidate, which is simulated again with more sub-steps until they suffice for its states along its motion.
    pub(crate) fn over(
        damper: &dyn Damper,
        laws: &CurrentLaws,
        theta: &[f64],
        loading: &LoadingHistory,
        settings: Settings<'_>,
    ) -> Result<Vec<Self>, DynamicsError> {
        let n_batch = theta.len() / laws.n_columns();
        let progress = BatchProgress::at_rest(damper.spec(), n_batch, None);
        let mut counts = vec![1; n_batch];
        let mut found = vec![Self { wanted: 1.0, substeps: Some(1) }; n_batch];
        let mut open: Vec<usize> = (0..n_batch).collect();
        while !open.is_empty() {
            open.sort_by_key(|&row| counts[row]);
            let steps = open.iter().map(|&row| u64::from(counts[row])).sum::<u64>() * loading.n_time() as u64;
            let threads = worthwhile_threads(settings.threads, steps);
            let share = open.len().div_ceil(threads).min(settings.instruction_set.block_width());
            let blocks: Vec<Block<'_>> = open
                .chunk_by(|&a, &b| counts[a] == counts[b])
                .flat_map(|group| group.chunks(share.next_multiple_of(VECTOR_WIDTH)))
                .map(|candidates| Block {
                    theta,
                    laws,
                    candidates,
                    loading,
                    span: 0..loading.n_time(),
                    progress: &progress,
                    substeps: counts[candidates[0]],
                    short: false,
                    stop: settings.stop,
                })
                .collect();
            let bounds = on_threads(threads, blocks.iter().collect(), |block: &Block<'_>| {
                damper.fastest(settings.instruction_set, block)
            })?;
            if (settings.stop)() {
                return Err(DynamicsError::Cancelled);
            }
            let ran: Vec<(usize, f64)> = (blocks.iter().zip(bounds))
                .flat_map(|(block, bounds)| block.candidates.iter().copied().zip(bounds))
                .collect();
            drop(blocks);
            open.clear();
            for (row, bound) in ran {
                let count = counts[row];
                let own = if bound.is_finite() { loading.dt() * bound / RESOLUTION } else { f64::INFINITY };
                let next = match power_of_two(own) {
                    // A run that is not finite says nothing of its states, and may be with finer steps.
                    _ if own == f64::INFINITY && !damper.relaxes_by_motion() => {
                        Some((FINER * count).min(MAX_SUBSTEPS))
                    }
                    next => next,
                };
                found[row] = Self { wanted: own, substeps: next.map(|next| next.max(count)) };
                // Half of the wanted steps are stable (their relaxation times the step is below 2.79) and tell as much.
                let again = next.map(|next| if own == f64::INFINITY { next } else { next / 2 });
                if let Some(again) = again
                    && again > count
                    && !damper.relaxes_by_motion()
                {
                    counts[row] = again;
                    open.push(row);
                }
            }
        }
        Ok(found)
    }
}

/// The smallest power of two that is not below `wanted`; `None` beyond [`MAX_SUBSTEPS`].
fn power_of_two(wanted: f64) -> Option<u32> {
    (0..=MAX_SUBSTEPS.ilog2()).map(|exponent| 1 << exponent).find(|&count| f64::from(count) >= wanted)
}

/// Result of one candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CandidateResult {
    /// Sum of squared residuals [N^2], infinite unless finished; zero if only the force was computed.
    pub squared_error: f64,
    /// How the simulation ended.
    pub outcome: Outcome,
    /// Sub-steps per sample interval, 0 if not simulated.
    pub substeps: u32,
    /// Number of steps simulated: fewer than those of the record for an abandoned candidate.
    pub steps: u64,
}

/// A batch whose arguments have been checked.
pub(crate) struct Schedule<'a> {
    pub(crate) laws: &'a CurrentLaws,
    pub(crate) theta: &'a [f64],
    pub(crate) loading: &'a LoadingHistory<'a>,
    pub(crate) settings: Settings<'a>,
    /// Result of each candidate if it is simulated to the end.
    pub(crate) rows: Vec<CandidateResult>,
    /// Candidates to simulate, those with the most sub-steps first.
    pub(crate) order: Vec<usize>,
    pub(crate) threads: usize,
    /// Whether a step of each candidate is a short chain of arithmetic.
    short: Vec<bool>,
    block_width: usize,
    steps: u64,
    varying: bool,
}

impl<'a> Schedule<'a> {
    pub(crate) fn new(
        damper: &'a dyn Damper,
        laws: &'a CurrentLaws,
        theta: &'a [f64],
        loading: &'a LoadingHistory<'a>,
        settings: Settings<'a>,
    ) -> Result<Self, DynamicsError> {
        let Settings { step_factor, threads, instruction_set, .. } = settings;
        if !(step_factor.is_power_of_two() && step_factor <= MAX_SUBSTEP_FACTOR) {
            return Err(DynamicsError::SubstepFactor { found: step_factor, most: MAX_SUBSTEP_FACTOR });
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
        let each: Vec<Option<u32>> = if damper.is_watched() && loading.substeps().is_none() {
            let watched = Watched::over(damper, laws, theta, loading, settings)?;
            watched.into_iter().map(|row| Some(row.substeps? * step_factor)).collect()
        } else {
            let rows = theta.chunks_exact(n_columns);
            rows.map(|theta| damper.substeps(theta, laws, loading, step_factor)).collect()
        };
        let rows: Vec<CandidateResult> = each
            .into_iter()
            .map(|substeps| {
                let outcome = if substeps.is_some() { Outcome::Finished } else { Outcome::Unresolved };
                CandidateResult {
                    squared_error: f64::INFINITY,
                    outcome,
                    substeps: substeps.unwrap_or(0),
                    steps: 0,
                }
            })
            .collect();
        let mut order: Vec<usize> = (0..rows.len()).filter(|&row| rows[row].substeps > 0).collect();
        order.sort_by_key(|&row| core::cmp::Reverse(rows[row].substeps));
        // A batch too small to fill every thread with full blocks is cut into narrower ones.
        let steps: u64 =
            rows.iter().map(|row| u64::from(row.substeps)).sum::<u64>() * loading.n_time() as u64;
        let varying = matches!(loading.command(), Command::Varying(_)) && !laws.are_constant();
        let short: Vec<bool> =
            theta.chunks_exact(n_columns).map(|theta| damper.has_short_step(theta, laws)).collect();
        let all_short = short.iter().all(|&short| short);
        let threads = worthwhile_threads(threads, if all_short { steps / SHORT_STEPS } else { steps });
        let block_width = match (varying, all_short) {
            (true, _) => VECTOR_WIDTH,
            (false, true) => instruction_set.side_by_side_width(),
            (false, false) => instruction_set.block_width(),
        };
        Ok(Self { laws, theta, loading, settings, rows, order, threads, short, block_width, steps, varying })
    }

    /// Blocks of these candidates, a subsequence of `order`.
    pub(crate) fn blocks<'b>(
        &'b self,
        candidates: &'b [usize],
        span: &Range<usize>,
        progress: &'b BatchProgress,
    ) -> Vec<Block<'b>> {
        let share = candidates.len().div_ceil(self.threads).next_multiple_of(VECTOR_WIDTH);
        // Equal shares per thread, each cut into blocks: otherwise the last blocks would leave a thread idle.
        let mut cut: Vec<&[usize]> = candidates
            .chunk_by(|&a, &b| self.rows[a].substeps == self.rows[b].substeps)
            .flat_map(|group| group.chunks(share))
            .flat_map(|share| {
                let blocks = share.len().div_ceil(self.block_width);
                share.chunks(share.len().div_ceil(blocks).next_multiple_of(VECTOR_WIDTH))
            })
            .collect();
        cut.sort_by_key(|block| core::cmp::Reverse((self.rows[block[0]].substeps, block.len())));
        cut.into_iter()
            .map(|candidates| Block {
                theta: self.theta,
                laws: self.laws,
                candidates,
                loading: self.loading,
                span: span.clone(),
                progress,
                substeps: self.rows[candidates[0]].substeps,
                short: candidates.iter().all(|&candidate| self.short[candidate]),
                stop: self.settings.stop,
            })
            .collect()
    }

    /// Threads for a batch in which each step costs as much as `cost` of a misfit.
    pub(crate) fn threads_at(&self, cost: u64) -> usize {
        worthwhile_threads(self.settings.threads, self.steps.saturating_mul(cost))
    }

    /// Spans of the record, in samples; candidates beyond their limits are dropped between spans.
    ///
    /// A single span under a varying command, because the state of the driver is not carried over.
    #[allow(clippy::cast_possible_truncation)] // at most MOST_SPANS
    pub(crate) fn spans(&self) -> Vec<Range<usize>> {
        let n_time = self.loading.n_time();
        let worthwhile = self.steps / (self.threads as u64 * STEPS_PER_SPAN);
        let count = if self.varying { 1 } else { worthwhile.clamp(1, MOST_SPANS) as usize };
        let length = n_time.div_ceil(count);
        (0..n_time).step_by(length).map(|start| start..(start + length).min(n_time)).collect()
    }
}
