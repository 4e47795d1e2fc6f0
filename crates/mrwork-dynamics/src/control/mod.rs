//! Control laws: the command of each device as a function of the measurements at a sample.
//!
//! A law is a formula over given numbers: gains, weights, thresholds, one set per candidate. Their design (Riccati equations,
//! pole placement, training) is not done here.

mod acceleration_driven;
mod active;
mod clipped_optimal;
mod decentralised_bang_bang;
mod direct_current;
mod force_curve;
mod fuzzy;
mod homogeneous_friction;
mod inverse_network;
mod loop_model;
mod lyapunov;
mod maximum_energy_dissipation;
mod passive;
mod rollout;
mod signal_feedback;
mod signals;
mod sliding_mode;

pub(crate) use force_curve::ForceCurve;
pub use force_curve::{CurveModel, Mounting};
pub use loop_model::LoopModel;
pub(crate) use rollout::{Plan, Timing, plan};
pub(crate) use signals::Further;
pub use signals::{Signal, Source};

use crate::building::SparseRows;
use crate::error::DynamicsError;
use crate::ground_motion::GroundMotion;
use crate::lanes::Lanes;
use crate::real::Real;

/// Shape of a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One per device.
    Device,
    /// One per device and state: displacement of every coordinate, then velocity of every coordinate.
    State,
    /// That many per device.
    Numbers(usize),
    /// That many per device and further signal of the law.
    Signal(usize),
    /// One for all devices.
    Loop,
}

/// Numbers on which the shapes of gains depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopSizes {
    /// Number of devices.
    pub n_devices: usize,
    /// Number of states.
    pub n_states: usize,
    /// Number of further signals of the law.
    pub n_signals: usize,
}

impl Shape {
    /// Its name in the spec.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::State => "state",
            Self::Numbers(_) => "numbers",
            Self::Signal(_) => "signal",
            Self::Loop => "loop",
        }
    }

    /// Numbers of a device, or of a device and signal, where there are several.
    #[must_use]
    pub const fn numbers(self) -> usize {
        match self {
            Self::Numbers(count) | Self::Signal(count) => count,
            Self::Device | Self::State | Self::Loop => 1,
        }
    }

    /// Number of entries.
    #[must_use]
    pub const fn size(self, sizes: LoopSizes) -> usize {
        let LoopSizes { n_devices, n_states, n_signals } = sizes;
        match self {
            Self::Device => n_devices,
            Self::State => n_devices * n_states,
            Self::Numbers(count) => n_devices * count,
            Self::Signal(count) => n_devices * n_signals * count,
            Self::Loop => 1,
        }
    }
}

/// Unit of a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A unit without that of the command.
    Of(&'static str),
    /// That of the command: the gain is itself the command of each device.
    Command,
    /// That of the command, per another unit.
    CommandPer(&'static str),
}

impl Unit {
    /// Its name in the spec.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Of(unit) => unit.to_owned(),
            Self::Command => "A or V".to_owned(),
            Self::CommandPer(unit) => format!("A or V, per {unit}"),
        }
    }

    /// Whether the gain is in proportion to the unit of the command.
    #[must_use]
    pub const fn has_command(self) -> bool {
        !matches!(self, Self::Of(_))
    }
}

/// A gain of a law; candidates may differ in it.
#[derive(Clone, Copy, Debug)]
pub struct GainSpec {
    /// Name.
    pub name: &'static str,
    /// SI unit; for a state gain that of the product with the state.
    pub unit: Unit,
    /// Shape.
    pub shape: Shape,
    /// What it does.
    pub description: &'static str,
}

/// Description of a control law.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools)] // properties of which none excludes another
pub struct LawSpec {
    /// Name in code and on the command line.
    pub name: &'static str,
    /// Name in prose.
    pub title: &'static str,
    /// The law.
    pub equation: &'static str,
    /// Use and limitations of the law.
    pub description: &'static str,
    /// Source of the formula.
    pub source: &'static str,
    /// Gains, in order.
    pub gains: &'static [GainSpec],
    /// Arrays that all candidates share: networks, rule tables.
    pub tables: &'static [&'static str],
    /// Numbers per device that it keeps from sample to sample.
    pub memory: usize,
    /// Whether it needs the damper force as a function of the command.
    pub needs_curve: bool,
    /// Whether it predicts the motion by a model of the loop, from the state and the ground acceleration.
    pub needs_model: bool,
    /// Whether its command is a force, for a device that exerts it, and not a current or voltage.
    pub commands_force: bool,
    /// Whether it reads the absolute accelerations of floors.
    pub reads_acceleration: bool,
    /// Whether it takes further signals, where some are given.
    pub takes_signals: bool,
}

impl LawSpec {
    /// Number of gain entries of one candidate.
    #[must_use]
    pub fn n_gains(&self, sizes: LoopSizes) -> usize {
        self.gains.iter().map(|gain| gain.shape.size(sizes)).sum()
    }
}

/// Input of a control law at a sample.
pub(crate) struct Measurement<'a, R: Real> {
    /// Displacements of the coordinates, true or estimated.
    pub(crate) displacement: &'a [R],
    /// Their velocities.
    pub(crate) velocity: &'a [R],
    /// Elongation of each device [m].
    pub(crate) deformation: &'a [R],
    /// Its rate [m/s].
    pub(crate) rate: &'a [R],
    /// Force with which each device resists [N].
    pub(crate) force: &'a [R],
    /// Absolute acceleration of each floor [m/s^2]; zero where the law does not read them.
    pub(crate) acceleration: &'a [R],
    /// Weights of these that add up to `e (q'' + r a_g)` of each device.
    pub(crate) device_floors: Option<&'a SparseRows>,
    /// Acceleration of the ground [m/s^2].
    pub(crate) ground_acceleration: R,
    /// Velocity of the ground [m/s].
    pub(crate) ground_velocity: R,
    /// What is known of the ground ahead.
    pub(crate) preview: Preview<'a>,
    /// Elongation of each device per displacement of the ground: e r.
    pub(crate) ground_reach: &'a [f64],
    /// Largest command of each device.
    pub(crate) largest: &'a [f64],
    /// Damper force as a function of the command, one per device, if the law needs it.
    pub(crate) curves: &'a [ForceCurve<R>],
    /// Sampling interval [s].
    pub(crate) sample_time: f64,
    /// Commands that were sent at the sample before, after limits and faults.
    pub(crate) sent: &'a [R],
}

/// Ground accelerations that a law is told before they come.
#[derive(Clone, Copy)]
pub(crate) struct Preview<'a> {
    /// Ground motion of each lane; lanes beyond have the last.
    pub(crate) motions: &'a [&'a GroundMotion],
    /// Present time [s].
    pub(crate) now: f64,
    /// Time that is known ahead, zero for none [s].
    pub(crate) reach: f64,
}

impl Preview<'_> {
    /// Whether the acceleration at a time ahead is known [s].
    #[inline(always)]
    fn reaches(&self, ahead: f64) -> bool {
        self.reach > 0.0 && ahead <= self.reach * (1.0 + 1e-9)
    }

    /// Acceleration at a time ahead [m/s^2].
    #[inline(always)]
    fn acceleration<R: Lanes>(&self, ahead: f64) -> R {
        let last = self.motions.len() - 1;
        R::from_fn(|lane| self.motions[lane.min(last)].acceleration(self.now + ahead))
    }
}

/// What a law keeps from sample to sample.
pub(crate) struct Memory<'a, R: Lanes> {
    /// Numbers of each device.
    pub(crate) numbers: Vec<R>,
    /// The further signals.
    pub(crate) further: Further<'a, R>,
    /// The rollout of a law that predicts the motion.
    pub(crate) plan: Option<Box<dyn Plan<R> + 'a>>,
}

impl<R: Real> Measurement<'_, R> {
    /// Absolute velocity of the upper end of a device less that of its lower end: `e (q' + r v_g)`.
    #[inline(always)]
    fn absolute_rate(&self, device: usize) -> R {
        R::splat(self.ground_reach[device]).mul_add(self.ground_velocity, self.rate[device])
    }

    /// Absolute acceleration of the upper end of a device less that of its lower end: `e (q'' + r a_g)`.
    #[inline(always)]
    fn absolute_acceleration(&self, device: usize) -> R {
        match self.device_floors {
            Some(floors) => floors.dot(device, self.acceleration),
            None => R::splat(f64::NAN),
        }
    }
}

/// Gains and tables of a law, in lanes.
pub(crate) struct Gains<'a, R> {
    pub(crate) spec: &'static LawSpec,
    pub(crate) columns: &'a [R],
    pub(crate) tables: &'a [Vec<f64>],
    pub(crate) sizes: LoopSizes,
}

impl<R: Real> Gains<'_, R> {
    #[inline(always)]
    fn start(&self, gain: usize) -> usize {
        let mut start = 0;
        for earlier in &self.spec.gains[..gain] {
            start += earlier.shape.size(self.sizes);
        }
        start
    }

    /// Entry of a device gain.
    #[inline(always)]
    fn of_device(&self, gain: usize, device: usize) -> R {
        self.columns[self.start(gain) + device]
    }

    /// Entry of a gain that all devices share.
    #[inline(always)]
    fn of_loop(&self, gain: usize) -> R {
        self.columns[self.start(gain)]
    }

    /// Entries of a device, of a gain of several numbers for each.
    #[inline(always)]
    fn numbers(&self, gain: usize, device: usize) -> &[R] {
        let count = self.spec.gains[gain].shape.size(LoopSizes { n_devices: 1, ..self.sizes });
        let start = self.start(gain) + device * count;
        &self.columns[start..start + count]
    }

    /// Product of the state gain of a device with the state.
    #[inline(always)]
    fn of_state(&self, gain: usize, device: usize, measured: &Measurement<'_, R>) -> R {
        let start = self.start(gain) + device * self.sizes.n_states;
        let weights = &self.columns[start..start + self.sizes.n_states];
        let (of_displacement, of_velocity) = weights.split_at(measured.displacement.len());
        let mut sum = R::splat(0.0);
        for (weight, value) in of_displacement.iter().zip(measured.displacement) {
            sum = weight.mul_add(*value, sum);
        }
        for (weight, value) in of_velocity.iter().zip(measured.velocity) {
            sum = weight.mul_add(*value, sum);
        }
        sum
    }
}

/// A control law: its formula, written once over `R: Lanes`.
///
/// `command` must be `#[inline(always)]`: it runs inside a function compiled for each instruction set.
trait ControlLaw {
    /// Name, prose, gains.
    const SPEC: LawSpec;

    /// Commands of all devices; the caller limits them to the admitted range.
    ///
    /// A command must not be a number if one of its inputs is not a number: the caller then sends zero.
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Memory<'_, R>,
        command: &mut [R],
    );

    /// Refuses tables of the wrong size.
    fn check_tables(_: &[Vec<f64>], _n_signals: usize) -> Result<(), DynamicsError> {
        Ok(())
    }
}

macro_rules! laws {
    ($($module:ident::$law:ident,)+) => {
        /// Every control law.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs)] // described in their specs
        pub enum Law { $($law,)+ }

        impl Law {
            /// All laws.
            pub const ALL: &[Self] = &[$(Self::$law,)+];

            /// Description of the law.
            #[must_use]
            pub fn spec(self) -> &'static LawSpec {
                match self { $(Self::$law => const { &<$module::$law as ControlLaw>::SPEC },)+ }
            }

            #[inline(always)]
            pub(crate) fn command<R: Lanes>(
                self, gains: &Gains<'_, R>, measured: &Measurement<'_, R>, memory: &mut Memory<'_, R>, command: &mut [R],
            ) {
                match self { $(Self::$law => $module::$law::command(gains, measured, memory, command),)+ }
            }

            pub(crate) fn check_tables(self, tables: &[Vec<f64>], n_signals: usize) -> Result<(), DynamicsError> {
                match self { $(Self::$law => $module::$law::check_tables(tables, n_signals),)+ }
            }
        }
    };
}

laws! {
    passive::Passive,
    clipped_optimal::ClippedOptimal,
    clipped_optimal::ModifiedClippedOptimal,
    clipped_optimal::ProportionalClippedOptimal,
    lyapunov::Lyapunov,
    decentralised_bang_bang::DecentralisedBangBang,
    maximum_energy_dissipation::MaximumEnergyDissipation,
    homogeneous_friction::ModulatedHomogeneousFriction,
    sliding_mode::SlidingMode,
    sliding_mode::AdaptiveSlidingMode,
    sliding_mode::SuperTwisting,
    fuzzy::Fuzzy,
    direct_current::LyapunovDirect,
    direct_current::LyapunovParabola,
    direct_current::LyapunovDirectBangBang,
    direct_current::ProportionalDirect,
    direct_current::InverseDirect,
    direct_current::InverseParabola,
    inverse_network::InverseNetwork,
    signal_feedback::SignalNetwork,
    signal_feedback::SignalPolynomial,
    active::Active,
    acceleration_driven::AccelerationDriven,
    acceleration_driven::MixedSkyhook,
    rollout::PredictiveRollout,
}

impl Law {
    /// The law of that name.
    #[must_use]
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|law| law.spec().name == name)
    }
}

/// Elongation of each device per displacement of the ground: e r.
pub(crate) fn ground_reach(devices: &SparseRows, influence: &[f64]) -> Vec<f64> {
    (0..devices.len()).map(|device| devices.dot(device, influence)).collect()
}

/// `yes` if `number` is above zero, else zero; not a number if `number` is not.
#[inline(always)]
fn where_positive<R: Real>(number: R, yes: R) -> R {
    let otherwise = if_known(number, R::splat(0.0));
    R::select(R::splat(0.0).less(number), yes, otherwise)
}

/// `value`; not a number if `by`, which it was chosen by, is not a number, which the comparison alone would hide.
#[inline(always)]
fn if_known<R: Real>(by: R, value: R) -> R {
    R::select(by.equal(by), value, R::splat(f64::NAN))
}

/// `number` limited to the range from `lower` to `upper`.
#[inline(always)]
pub(crate) fn within<R: Real>(number: R, lower: R, upper: R) -> R {
    upper.min(lower.max(number))
}
