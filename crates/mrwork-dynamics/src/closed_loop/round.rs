//! One round of a batch: runs cut into blocks of lanes, simulated on threads, results put in their places.

use std::collections::BTreeMap;

use super::batch::{Batch, Settings, n_samples};
use super::block::{Block, Left};
use super::history::{History, width as history_width};
use crate::error::DynamicsError;
use crate::threads::{on_threads, thread_count};

/// Blocks between two times that results are put in their place: bounds what is held twice.
const BLOCKS_AT_A_TIME: usize = 1024;

/// Where results go.
pub(super) struct Out<'a> {
    pub(super) summary: &'a mut [f64],
    pub(super) histories: Option<&'a mut [Vec<f64>]>,
    pub(super) width: usize,
}

impl Out<'_> {
    pub(super) fn row(&mut self, run: usize) -> &mut [f64] {
        &mut self.summary[run * self.width..][..self.width]
    }

    /// Leaves nothing of a run that was tried with too long a step.
    pub(super) fn forget_history(&mut self, run: usize) {
        if let Some(histories) = &mut self.histories {
            histories[run].fill(f64::INFINITY);
        }
    }
}

impl Batch<'_> {
    /// Runs these once, each with so many steps per sample.
    pub(super) fn round(
        &self,
        pending: &[(usize, u32)],
        out: &mut Out<'_>,
        settings: Settings<'_>,
    ) -> Result<Vec<(usize, u32, Left)>, DynamicsError> {
        let set = settings.instruction_set.or_plain();
        let threads = thread_count(settings.threads);
        let mut groups: BTreeMap<(u32, usize), Vec<usize>> = BTreeMap::new();
        for &(run, steps) in pending {
            let samples = n_samples(&self.motions[self.runs[run].motion as usize], self.hardware);
            groups.entry((steps, samples)).or_default().push(run);
        }
        let mut lefts = Vec::with_capacity(pending.len());
        for ((steps, samples), mut runs) in groups {
            // Side by side under the same motion, as far as there are enough.
            runs.sort_by_key(|&run| self.runs[run].motion);
            let width = set.middle_width();
            let n_blocks = runs.len().div_ceil(width).next_multiple_of(threads).min(runs.len());
            let cut: Vec<&[usize]> = runs.chunks(runs.len().div_ceil(n_blocks).min(width)).collect();
            for blocks in cut.chunks(BLOCKS_AT_A_TIME) {
                let work: Vec<(&[usize], Vec<Vec<f64>>)> =
                    blocks.iter().map(|&runs| (runs, out.lend(runs))).collect();
                let done = on_threads(threads, work, |(runs, mut rows): (&[usize], Vec<Vec<f64>>)| {
                    let motion = |run: &usize| &self.motions[self.runs[*run].motion as usize];
                    let block = Block {
                        batch: self,
                        runs,
                        motions: runs.iter().map(motion).collect(),
                        n_samples: samples,
                        steps,
                        stop: settings.stop,
                    };
                    let width = history_width(self.building);
                    let mut histories: Vec<History<'_>> =
                        rows.iter_mut().map(|rows| History { rows, width }).collect();
                    (runs, self.damper.respond(set, &block, &mut histories), rows)
                })?;
                if (settings.stop)() {
                    return Err(DynamicsError::Cancelled);
                }
                for (runs, left, rows) in done {
                    out.take_back(runs, rows);
                    for (&run, mut left) in runs.iter().zip(left) {
                        out.row(run).copy_from_slice(&left.row);
                        left.row = Vec::new();
                        lefts.push((run, steps, left));
                    }
                }
            }
        }
        Ok(lefts)
    }
}

impl Out<'_> {
    /// The histories of these runs, to be written elsewhere.
    fn lend(&mut self, runs: &[usize]) -> Vec<Vec<f64>> {
        match &mut self.histories {
            Some(histories) => runs.iter().map(|&run| core::mem::take(&mut histories[run])).collect(),
            None => Vec::new(),
        }
    }

    fn take_back(&mut self, runs: &[usize], rows: Vec<Vec<f64>>) {
        if let Some(histories) = &mut self.histories {
            for (&run, rows) in runs.iter().zip(rows) {
                histories[run] = rows;
            }
        }
    }
}
