//! Buildings that carry dampers, under ground motions and control laws: candidates x motions x draws of the damper in
//! one call, in lanes.
//!
//! A lane is a run ([`batch`]): a set of gains, a motion, a set of damper parameters. The controller sees what its sensors
//! tell ([`hardware`]) at its sample times; between these the loop is integrated by classical Runge-Kutta, building and
//! dampers as one system. What is kept are peaks, mean squares and energies, and histories where they are asked for.

mod batch;
mod block;
mod check;
mod dampers;
mod hardware;
mod history;
mod ideal_actuator;
mod noise;
mod plant;
mod reductions;
mod resolution;
mod round;
mod sample;

pub use batch::{Batch, Run, RunResult, Settings, n_samples, respond};
pub(crate) use block::run as run_block;
pub use block::{Block, Left};
pub use hardware::{Channel, Fault, Hardware, Observer, Sensor};
pub use history::{History, layout as history_layout};
pub use reductions::layout as summary_layout;

use crate::any_damper::Damper;

/// The device of that name: a damper model, or the ideal actuator.
#[must_use]
pub fn find_device(name: &str) -> Option<&'static dyn Damper> {
    crate::damper::find(name).or_else(|| {
        let actuator: &'static dyn Damper = &ideal_actuator::IdealActuator;
        (actuator.spec().name == name).then_some(actuator)
    })
}
