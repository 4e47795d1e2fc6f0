//! Work for any number of lanes, and how many vectors the packs have in which it runs.

use crate::lanes::Lanes;
use crate::real::Bits;

/// Vectors in the widest pack: enough to hide the latency of a power and a division.
pub(super) const GROUPS: usize = 8;
/// Pairs of vectors in a pack of the loop: shared data are loaded once, and the state of a step stays in the cache. Work that
/// keeps its numbers in registers takes one pair after the other.
pub(super) const MIDDLE_PAIRS: usize = 2;

/// Work that is written once for any number of lanes.
pub trait LaneJob {
    /// What the work returns.
    type Output;
    /// The type in whose module the job is compiled, see [`crate::real::OutOfLine::Home`].
    type Home;
    /// Runs with the lanes of `R`. Must be `#[inline(always)]`, and so must all functions that it calls.
    fn run<R: Lanes + Bits>(self) -> Self::Output;
}
