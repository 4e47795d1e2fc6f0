//! One round of a batch: runs grouped into blocks of lanes, simulated on threads, results copied to the output.

use std::collections::BTreeMap;

use super::batch::{Batch, n_samples};
use super::block::{Block, LaneResult, Respond};
use super::history::{HistoryRows, width as history_width};
use crate::any_damper::Damper;
use crate::damper::visit;
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
    damper: &dyn Damper,
    batch: &Batch<'_>,
    pending: &[(usize, u32)],
    output: &mut Output<'_>,
    settings: Settings<'_>,
) -> Result<Vec<(usize, u32, LaneResult)>, DynamicsError> {
    let set = settings.instruction_set.or_plain();
    let threads = thread_count(settings.threads);
    // Lanes of a block have equal operations: places of the springs of the first run with the pattern of each.
    let mut patterns: Vec<usize> = Vec::with_capacity(batch.springs.len());
    for (place, own) in batch.springs.iter().enumerate() {
        let known = (0..place).find(|&known| batch.springs[known].rows.has_pattern_of(&own.rows));
        patterns.push(known.unwrap_or(place));
    }
    let pattern = |run: usize| patterns.get(batch.runs[run].springs as usize).copied().unwrap_or(0);
    let mut groups: BTreeMap<(u32, usize, usize), Vec<usize>> = BTreeMap::new();
    for &(run, steps) in pending {
        let samples = n_samples(&batch.motions[batch.runs[run].motion as usize], batch.hardware);
        groups.entry((steps, samples, pattern(run))).or_default().push(run);
    }
    let mut results = Vec::with_capacity(pending.len());
    for ((steps, samples, _), mut runs) in groups {
        // Runs under the same motion share a block where possible, and those of one realisation of the building.
        runs.sort_by_key(|&run| (batch.runs[run].motion, batch.runs[run].springs));
        let width = set.middle_width();
        let n_blocks = runs.len().div_ceil(width).next_multiple_of(threads).min(runs.len());
        let cut: Vec<&[usize]> = runs.chunks(runs.len().div_ceil(n_blocks).min(width)).collect();
        for blocks in cut.chunks(BLOCKS_AT_A_TIME) {
            let work: Vec<(&[usize], Vec<Vec<f64>>)> =
                blocks.iter().map(|&runs| (runs, output.lend(runs))).collect();
            let done = on_threads(threads, work, |(runs, mut rows): (&[usize], Vec<Vec<f64>>)| {
                let motion = |run: &usize| &batch.motions[batch.runs[*run].motion as usize];
                let block = Block {
                    batch,
                    runs,
                    motions: runs.iter().map(motion).collect(),
                    n_samples: samples,
                    steps,
                    stop: settings.stop,
                };
                let width = history_width(batch.building);
                let mut histories: Vec<HistoryRows<'_>> =
                    rows.iter_mut().map(|rows| HistoryRows { rows, width }).collect();
                let respond = Respond { set, block: &block, histories: &mut histories };
                (runs, visit(damper.spec().name, respond), rows)
            })?;
            if (settings.stop)() {
                return Err(DynamicsError::Cancelled);
            }
            for (runs, lanes, rows) in done {
                let lanes = lanes.ok_or(DynamicsError::UnknownDevice(damper.spec().name))?;
                output.take_back(runs, rows);
                for (&run, mut lane) in runs.iter().zip(lanes) {
                    output.row(run).copy_from_slice(&lane.row);
                    lane.row = Vec::new();
                    results.push((run, steps, lane));
                }
            }
        }
    }
    Ok(results)
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
