//! Work for any number of lanes.

use crate::lanes::Lanes;
use crate::real::Bits;

/// Work that is written once for any number of lanes.
pub trait LaneJob {
    /// What the work returns.
    type Output;
    /// The type in whose module the job is compiled, see [`crate::real::OutOfLine::Home`].
    type Home;
    /// Runs with the lanes of `R`. Must be `#[inline(always)]`, and so must all functions that it calls.
    fn run<R: Lanes + Bits>(self) -> Self::Output;
}
