//! The prediction of a law that tries commands on the controller's own model, under a forecast of the ground motion.

mod copy;
mod forecast;
mod planner;
mod prediction;
mod storeys;
mod timing;

pub use planner::recorded::RolloutText;
pub(super) use planner::{LEVELS, OTHER_TAILS};
pub(crate) use planner::{Planner, plan};
pub(crate) use storeys::reads_accelerations;
pub(crate) use timing::Timing;
