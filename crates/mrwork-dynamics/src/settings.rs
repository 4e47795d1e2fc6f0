//! Settings of a batch, of damper tests as of closed loops.

use crate::dispatch::InstructionSet;
use crate::threads::StopRequested;

/// Steps, threads and instruction set of a batch.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// Multiplies the number of steps that each candidate or run needs: 1 by default, more to check convergence.
    pub step_factor: u32,
    /// Threads to use, 0 for all.
    pub threads: usize,
    /// Vector instructions to use.
    pub instruction_set: InstructionSet,
    /// Whether the caller wants to cancel the batch.
    pub stop: &'a StopRequested<'a>,
}
