//! One round of a batch: runs grouped into blocks of lanes, simulated on threads, results copied to the output.

use std::collections::BTreeMap;

use super::batch::{Batch, n_samples};
use super::block::{Block, LaneResult, simulate};
use super::directions::Directions;
use super::history::{HistoryRows, width as history_width};
use crate::error::DynamicsError;
use crate::settings::Settings;
use crate::threads::{on_threads, thread_count};

/// Blocks simulated before their results are copied: bounds the memory for results that are held twice.
const BLOCKS_AT_A_TIME: usize = 1024;

/// Output arrays of a batch.
pub(super) struct Output<'a> {
    pub(super) summary: &'a mut [f64],
    pub(super) histories: Option<&'a mut [Vec<f64>]>,
    pub(super) width: usize,
}

impl Output<'_> {
    /// Summary of a run.
    pub(super) fn row(&mut self, run: usize) -> &mut [f64] {
        &mut self.summary[run * self.width..][..self.width]
    }

    /// Sets the history of a run to infinity: its step was too long.
    pub(super) fn invalidate_history(&mut self, run: usize) {
        if let Some(histories) = &mut self.histories {
            histories[run].fill(f64::INFINITY);
        }
    }
}

/// Simulates the `pending` runs, pairs of run and steps per sample.
pub(super) fn round(
    batch: &Batch<'_>,
    directions: Option<Directions<'_>>,
    pending: &[(usize, u32)],
    output: &mut Output<'_>,
    settings: Settings<'_>,
) -> Result<Vec<(usize, u32, LaneResult)>, DynamicsError> {
    let set = settings.instruction_set;
    let threads = thread_count(settings.threads);
    // Lanes of a block have equal operations: places of the springs of the first run with the pattern of each.
    let mut patterns: Vec<usize> = Vec::with_capacity(batch.springs.len());
    for (place, own) in batch.springs.iter().enumerate() {
        let known = (0..place).find(|&known| batch.springs[known].rows.has_pattern_of(&own.rows));
        patterns.push(known.unwrap_or(place));
    }
    let pattern = |run: usize| patterns.get(batch.runs[run].springs as usize).copied().unwrap_or(0);
    // Runs with forces on floors are apart from those without.
    let mut groups: BTreeMap<(u32, usize, usize, bool), Vec<usize>> = BTreeMap::new();
    for &(run, steps) in pending {
        let motion = &batch.motions[batch.runs[run].motion as usize];
        let samples = n_samples(motion, batch.hardware);
        groups.entry((steps, samples, pattern(run), motion.n_forced() > 0)).or_default().push(run);
    }
    // Of a record finer than the step, made once for all lanes.
    let mut stages = BTreeMap::new();
    for (&(steps, samples, ..), runs) in &groups {
        for &run in runs {
            let motion = batch.runs[run].motion;
            stages.entry((motion, steps)).or_insert_with(|| {
                let step = batch.hardware.sample_time / f64::from(steps);
                let (motion, count) = (&batch.motions[motion as usize], samples * steps as usize);
                (motion.stages(step, count), motion.force_stages(step, count))
            });
        }
    }
    let width = if directions.is_some() { set.vector_width() } else { set.middle_width() };
    let full: usize = groups.values().map(|runs| runs.len().div_ceil(width)).sum();
    // Blocks are cut finer only where there are fewer than threads: a block takes as long with half of its lanes.
    let finer = threads.div_ceil(full.max(1));
    let mut cut: Vec<Cut<'_>> = Vec::with_capacity(full * finer);
    for (&(steps, samples, ..), runs) in &mut groups {
        // Runs under the same motion share a block where possible, and those of one realisation of the building.
        runs.sort_by_key(|&run| (batch.runs[run].motion, batch.runs[run].springs));
        let n_blocks = (runs.len().div_ceil(width) * finer).min(runs.len());
        let blocks = runs.chunks(runs.len().div_ceil(n_blocks).min(width));
        cut.extend(blocks.map(|runs| Cut { runs, steps, samples }));
    }
    // Those that take longest come first, so that no thread waits for one at the end.
    cut.sort_by_key(|block| core::cmp::Reverse(block.samples * block.steps as usize));
    let mut results = Vec::with_capacity(pending.len());
    for blocks in cut.chunks(BLOCKS_AT_A_TIME) {
        let work: Vec<(&Cut<'_>, Vec<Vec<f64>>)> =
            blocks.iter().map(|block| (block, output.lend(block.runs))).collect();
        let done = on_threads(threads, work, |(cut, mut rows): (&Cut<'_>, Vec<Vec<f64>>)| {
            let motion = |run: &usize| &batch.motions[batch.runs[*run].motion as usize];
            let finer = |run: &usize| stages.get(&(batch.runs[*run].motion, cut.steps));
            let block = Block {
                batch,
                runs: cut.runs,
                motions: cut.runs.iter().map(motion).collect(),
                stages: cut.runs.iter().map(|run| finer(run)?.0.as_deref()).collect(),
                force_stages: cut.runs.iter().map(|run| finer(run)?.1.as_deref()).collect(),
                n_samples: cut.samples,
                steps: cut.steps,
                directions,
                stop: settings.stop,
            };
            let width = history_width(batch.building);
            let mut histories: Vec<HistoryRows<'_>> =
                rows.iter_mut().map(|rows| HistoryRows { rows, width }).collect();
            (cut, simulate(set, &block, &mut histories), rows)
        })?;
        if (settings.stop)() {
            return Err(DynamicsError::Cancelled);
        }
        for (cut, lanes, rows) in done {
            output.take_back(cut.runs, rows);
            for (&run, mut lane) in cut.runs.iter().zip(lanes?) {
                output.row(run).copy_from_slice(&lane.row);
                lane.row = Vec::new();
                results.push((run, cut.steps, lane));
            }
        }
    }
    Ok(results)
}

/// Runs of a block, with their steps per sample and their number of samples.
struct Cut<'a> {
    runs: &'a [usize],
    steps: u32,
    samples: usize,
}

impl Output<'_> {
    /// Takes the history vectors of these runs, so that a block can own them.
    fn lend(&mut self, runs: &[usize]) -> Vec<Vec<f64>> {
        match &mut self.histories {
            Some(histories) => runs.iter().map(|&run| core::mem::take(&mut histories[run])).collect(),
            None => Vec::new(),
        }
    }

    /// Puts the history vectors of these runs back.
    fn take_back(&mut self, runs: &[usize], rows: Vec<Vec<f64>>) {
        if let Some(histories) = &mut self.histories {
            for (&run, rows) in runs.iter().zip(rows) {
                histories[run] = rows;
            }
        }
    }
}
