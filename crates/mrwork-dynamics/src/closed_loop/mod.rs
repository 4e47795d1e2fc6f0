//! Closed-loop simulation of buildings with dampers under ground motions and control laws: candidates x motions x draws
//! of the damper parameters in one call.
//!
//! A lane is one run ([`batch`]): a set of gains, a motion, a set of damper parameters. The controller measures and
//! commands at its sample times ([`sample`], [`hardware`]); between them building and dampers are integrated as one system
//! by classical Runge-Kutta ([`block`]). Results are peaks, mean squares and energies ([`reductions`]) and, if requested,
//! histories ([`history`]).

mod batch;
mod block;
mod check;
mod directions;
mod hardware;
mod history;
mod noise;
mod own_law;
mod quantity;
mod recorded;
mod reductions;
mod resolution;
mod respond;
mod round;
mod sample;
mod slopes;

pub use batch::{Batch, BlockSample, OutsideLaw, Run, Shaping, n_samples};
pub use block::{Block, LaneResult};
pub use directions::Directions;
pub use hardware::{Channel, Fault, Hardware, Observer, Sensor};
pub use history::{HISTORY_SIGNALS, HistoryRows};
pub use own_law::{Input, OwnLaw, Source};
pub use quantity::{Axis, Quantity, width};
pub use recorded::{LawText, commands_of, law_text, readings_of};
pub use reductions::RUN_QUANTITIES;
pub use respond::{RunResult, respond};
pub use slopes::respond_with_slopes;
