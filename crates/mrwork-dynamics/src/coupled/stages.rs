//! The stages of a step of classical Runge-Kutta, and the times within it.

/// Times within a step at which parameters of the dampers are stored.
pub(super) const MIDDLE: usize = 0;
pub(crate) const END: usize = 1;

/// How the stage before is left: its weight in the sums over the step, how far after the start of the step the next one
/// is [s], and the parameters that are in force there.
pub(crate) struct Stage {
    pub(crate) weight: f64,
    pub(crate) reach: f64,
    pub(crate) moment: usize,
}

/// The stages of a step after its start.
pub(crate) fn stages(step: f64) -> [Stage; 3] {
    let (half, sixth, third) = (0.5 * step, step / 6.0, step / 3.0);
    [
        Stage { weight: sixth, reach: half, moment: MIDDLE },
        Stage { weight: third, reach: half, moment: MIDDLE },
        Stage { weight: third, reach: step, moment: END },
    ]
}
