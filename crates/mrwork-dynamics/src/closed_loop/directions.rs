//! Directions of derivatives, and which of them a lane has.

use super::batch::Batch;
use crate::dual_block::TANGENTS;

/// Directions along which the results of runs are differentiated.
#[derive(Clone, Copy, Debug)]
pub struct Directions<'a> {
    /// Directions of each candidate.
    pub count: usize,
    /// Change of every gain along each, shape (candidates, count, gains).
    pub changes: &'a [f64],
}

impl Directions<'_> {
    /// Runs in which a run is repeated, each with as many directions as a dual number has.
    pub(super) fn groups(&self) -> usize {
        self.count.div_ceil(TANGENTS)
    }

    /// Change of a gain along a direction of a repeated run.
    pub(super) fn change(&self, batch: &Batch<'_>, run: usize, gain: usize, tangent: usize) -> f64 {
        let direction = run % self.groups() * TANGENTS + tangent;
        if direction >= self.count {
            return 0.0;
        }
        let row = batch.runs[run].candidate as usize * self.count + direction;
        self.changes[row * batch.law.spec().n_gains(batch.sizes()) + gain]
    }
}
