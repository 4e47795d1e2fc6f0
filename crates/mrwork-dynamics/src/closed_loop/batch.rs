//! The arguments of a batch of closed-loop runs.

use super::hardware::{Hardware, Observer};
use super::own_law::OwnLaw;
use crate::building::{Building, Springs};
use crate::control::{CurveModel, Law, LoopModel, LoopSizes, reads_accelerations};
use crate::coupled::{Group, n_devices};
use crate::ground_motion::GroundMotion;

/// One run: a set of gains, a ground motion, a draw of the damper parameters, a realisation of building and delay.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Row of the gains.
    pub candidate: u32,
    /// Index of the motion.
    pub motion: u32,
    /// Row of the damper parameters.
    pub draw: u32,
    /// Index of stiffness and damping of the building; 0 without any.
    pub springs: u32,
    /// Integration steps of delay beyond that of the hardware.
    pub delay_steps: u32,
    /// Stream of the sensor noise; runs with the same stream have the same noise.
    pub stream: u64,
}

/// What is done to the command of any law before it is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaping {
    /// Damper velocity below which the command is zero [m/s].
    pub dead_zone: f64,
    /// Largest change of the command per time [A/s or V/s].
    pub slope: f64,
}

impl Shaping {
    /// A command that is sent as it is.
    pub const NONE: Self = Self { dead_zone: 0.0, slope: f64::INFINITY };
}

/// What a law outside of the core receives at a control sample: a row for each run of a block.
pub struct BlockSample<'a> {
    /// The runs, by their places in [`Batch::runs`].
    pub runs: &'a [usize],
    /// Number of the sample, from 0.
    pub number: usize,
    /// Displacements of the coordinates, true or estimated, shape (runs, coordinates).
    pub displacement: &'a [f64],
    /// Their velocities.
    pub velocity: &'a [f64],
    /// Elongation of each device [m], shape (runs, devices).
    pub deformation: &'a [f64],
    /// Its rate [m/s].
    pub rate: &'a [f64],
    /// Force with which each device resists [N].
    pub force: &'a [f64],
    /// Absolute acceleration of each floor [m/s^2], shape (runs, floors).
    pub acceleration: &'a [f64],
    /// Acceleration of the ground [m/s^2], one per run.
    pub ground_acceleration: &'a [f64],
    /// Velocity of the ground [m/s], one per run.
    pub ground_velocity: &'a [f64],
    /// Drift of each measured storey [m], shape (runs, measured storeys).
    pub drift: &'a [f64],
}

/// A control law outside of the core, in place of one of the registry.
pub trait OutsideLaw: Sync {
    /// Writes the command of each run and device, shape (runs, devices), at a control sample.
    ///
    /// A simulation that is repeated with a shorter step asks again from sample 0 on.
    fn command(&self, sample: &BlockSample<'_>, commands: &mut [f64]);
}

/// Runs and the data that they share.
#[derive(Clone)]
pub struct Batch<'a> {
    /// The building, with the rows of its devices.
    pub building: &'a Building,
    /// Stiffness and damping of the building in runs that have others than its own; empty if none has.
    pub springs: &'a [Springs],
    /// The dampers, in the order of the devices; all groups have equally many draws.
    pub dampers: &'a [Group<'a>],
    /// Smallest and largest command of each device.
    pub ranges: &'a [[f64; 2]],
    /// Devices that the law commands, the first ones; the others hold their smallest command.
    pub n_commanded: usize,
    /// The control law.
    pub law: Law,
    /// A law of a user on a tape that commands instead of `law`.
    pub own: Option<&'a OwnLaw>,
    /// A law outside of the core that commands instead of `law`.
    pub outside: Option<&'a dyn OutsideLaw>,
    /// Gains of `law`, shape (candidates, gains).
    pub gains: &'a [f64],
    /// Its tables.
    pub tables: &'a [Vec<f64>],
    /// Dead zone and slope of each candidate; empty if none has any.
    pub shaping: &'a [Shaping],
    /// The controller's own model of the dampers.
    pub curve: Option<CurveModel<'a>>,
    /// The controller's own model of the loop.
    pub model: Option<LoopModel<'a>>,
    /// The ground motions.
    pub motions: &'a [GroundMotion],
    /// The runs.
    pub runs: &'a [Run],
    /// Sampling, delay, sensors, limits and faults.
    pub hardware: &'a Hardware,
    /// State observer; without one the law uses the true state.
    pub observer: Option<&'a Observer>,
}

impl<'a> Batch<'a> {
    /// Dead zone and slope of a candidate.
    pub(super) fn shaping_of(&self, candidate: usize) -> Shaping {
        self.shaping.get(candidate).copied().unwrap_or(Shaping::NONE)
    }

    /// Stiffness and damping of the building in a run.
    pub(super) fn springs_of(&self, run: usize) -> &'a Springs {
        self.springs.get(self.runs[run].springs as usize).unwrap_or(&self.building.springs)
    }

    /// Integration steps of the hardware from a measurement of a run until its command is sent.
    pub(super) fn delay_of(&self, run: usize) -> usize {
        self.hardware.delay_steps + self.runs[run].delay_steps as usize
    }

    /// Sizes of the gains of the law.
    pub(super) fn sizes(&self) -> LoopSizes {
        LoopSizes { n_devices: self.n_commanded, n_states: 2 * self.building.n }
    }

    /// Whether the law reads the absolute accelerations of floors.
    pub(super) fn reads_acceleration(&self) -> bool {
        self.law.spec().reads_acceleration
            || self.own.is_some_and(OwnLaw::reads_acceleration)
            || self.outside.is_some()
            || self.model_reads_acceleration()
    }

    /// Whether the prediction of the law does: its tables were checked, and the last is of the storeys.
    pub(super) fn model_reads_acceleration(&self) -> bool {
        let (Some(model), Some(shears)) = (&self.model, self.tables.last()) else { return false };
        self.law.spec().needs_model && reads_accelerations(model.building, shears)
    }

    /// Number of devices.
    pub(super) fn n_devices(&self) -> usize {
        n_devices(self.dampers)
    }

    /// Number of rows of damper parameters; 1 without devices.
    pub(super) fn n_draws(&self) -> usize {
        self.dampers.first().and_then(Group::n_draws).unwrap_or(1)
    }
}

/// Number of control samples of a motion.
#[must_use]
pub fn n_samples(motion: &GroundMotion, hardware: &Hardware) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a duration is positive
    let samples = (motion.duration() / hardware.sample_time * (1.0 + 1e-12)).floor() as usize;
    // One more, for the end of the motion, is still a number.
    samples.clamp(1, usize::MAX - 1)
}
