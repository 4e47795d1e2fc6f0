//! Control laws: what each device is told, from what is known of the building at a sample.
//!
//! A law is a formula over finished numbers: gains, weights, thresholds, one set per candidate. Where these come from
//! (Riccati equations, pole placement, training) is no matter of the loop.

mod active;
mod clipped_optimal;
mod decentralised_bang_bang;
mod direct_current;
mod force_curve;
mod fuzzy;
mod homogeneous_friction;
mod inverse_network;
mod lyapunov;
mod maximum_energy_dissipation;
mod passive;
mod sliding_mode;

pub use force_curve::CurveModel;
pub(crate) use force_curve::ForceCurve;
pub use force_curve::Place;

use crate::building::SparseRows;
use crate::error::DynamicsError;
use crate::lanes::Lanes;
use crate::real::Real;

/// How many numbers a gain has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One per device.
    Device,
    /// One per device and state: displacement of every coordinate, then velocity of every coordinate.
    State,
}

impl Shape {
    /// Its name in the spec.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::State => "state",
        }
    }

    /// Numbers, for so many devices and states.
    #[must_use]
    pub const fn size(self, n_devices: usize, n_states: usize) -> usize {
        match self {
            Self::Device => n_devices,
            Self::State => n_devices * n_states,
        }
    }
}

/// A gain of a law; candidates may differ in it.
#[derive(Clone, Copy, Debug)]
pub struct GainSpec {
    /// Name.
    pub name: &'static str,
    /// SI unit; for a state gain that of the product with the state.
    pub unit: &'static str,
    /// How many numbers.
    pub shape: Shape,
    /// What it does.
    pub description: &'static str,
}

/// What a law says of itself.
#[derive(Clone, Copy, Debug)]
pub struct LawSpec {
    /// Name in code and on the command line.
    pub name: &'static str,
    /// Name in prose.
    pub title: &'static str,
    /// The law.
    pub equation: &'static str,
    /// What it is good for, and its traps.
    pub description: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// Gains, in order.
    pub gains: &'static [GainSpec],
    /// Arrays that all candidates share: networks, rule tables.
    pub tables: &'static [&'static str],
    /// Numbers that it remembers for each device from sample to sample.
    pub memory: usize,
    /// Whether it wants the force as a function of the command.
    pub wants_curve: bool,
}

impl LawSpec {
    /// Gains of one candidate, in numbers.
    #[must_use]
    pub fn n_gains(&self, n_devices: usize, n_states: usize) -> usize {
        self.gains.iter().map(|gain| gain.shape.size(n_devices, n_states)).sum()
    }
}

/// What is known when a command is worked out.
pub(crate) struct Seen<'a, R: Real> {
    /// Displacements of the coordinates, as measured or estimated.
    pub(crate) displacement: &'a [R],
    /// Their velocities.
    pub(crate) velocity: &'a [R],
    /// Elongation of each device [m].
    pub(crate) deformation: &'a [R],
    /// Its rate [m/s].
    pub(crate) rate: &'a [R],
    /// Force with which each device resists [N].
    pub(crate) force: &'a [R],
    /// Velocity of the ground [m/s].
    pub(crate) ground_velocity: R,
    /// How each device is elongated when the ground alone moves back by 1 m.
    pub(crate) ground_reach: &'a [f64],
    /// Largest command of each device.
    pub(crate) largest: &'a [f64],
    /// Force over command, one per device, where the law wants it.
    pub(crate) curves: &'a [ForceCurve<R>],
    /// Time from sample to sample [s].
    pub(crate) sample_time: f64,
}

/// The numbers of a law in lanes.
pub(crate) struct Gains<'a, R> {
    pub(crate) spec: &'static LawSpec,
    pub(crate) columns: &'a [R],
    pub(crate) tables: &'a [Vec<f64>],
    pub(crate) n_devices: usize,
    pub(crate) n_states: usize,
}

impl<R: Real> Gains<'_, R> {
    #[inline(always)]
    fn start(&self, gain: usize) -> usize {
        let mut start = 0;
        for earlier in &self.spec.gains[..gain] {
            start += earlier.shape.size(self.n_devices, self.n_states);
        }
        start
    }

    /// A gain that a device has one of.
    #[inline(always)]
    fn of_device(&self, gain: usize, device: usize) -> R {
        self.columns[self.start(gain) + device]
    }

    /// The product of a state gain of a device with the state.
    #[inline(always)]
    fn of_state(&self, gain: usize, device: usize, seen: &Seen<'_, R>) -> R {
        let start = self.start(gain) + device * self.n_states;
        let weights = &self.columns[start..start + self.n_states];
        let (of_displacement, of_velocity) = weights.split_at(seen.displacement.len());
        let mut sum = R::splat(0.0);
        for (weight, value) in of_displacement.iter().zip(seen.displacement) {
            sum = weight.mul_add(*value, sum);
        }
        for (weight, value) in of_velocity.iter().zip(seen.velocity) {
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

    /// Commands of all devices; what leaves the admitted range is cut off by the caller.
    ///
    /// Where what it needs is not a number the command is none either, so that the caller knows.
    fn command<R: Lanes>(gains: &Gains<'_, R>, seen: &Seen<'_, R>, memory: &mut [R], command: &mut [R]);

    /// Refuses tables of sizes that it cannot read.
    fn check_tables(_: &[Vec<f64>]) -> Result<(), DynamicsError> {
        Ok(())
    }
}

macro_rules! laws {
    ($($module:ident::$law:ident,)+) => {
        /// Every control law.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs)] // each says what it is in its spec
        pub enum Law { $($law,)+ }

        impl Law {
            /// All laws.
            pub const ALL: &[Self] = &[$(Self::$law,)+];

            /// What the law says of itself.
            #[must_use]
            pub fn spec(self) -> &'static LawSpec {
                match self { $(Self::$law => const { &<$module::$law as ControlLaw>::SPEC },)+ }
            }

            #[inline(always)]
            pub(crate) fn command<R: Lanes>(
                self, gains: &Gains<'_, R>, seen: &Seen<'_, R>, memory: &mut [R], command: &mut [R],
            ) {
                match self { $(Self::$law => $module::$law::command(gains, seen, memory, command),)+ }
            }

            pub(crate) fn check_tables(self, tables: &[Vec<f64>]) -> Result<(), DynamicsError> {
                match self { $(Self::$law => $module::$law::check_tables(tables),)+ }
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
    direct_current::LyapunovDirectBangBang,
    direct_current::ProportionalDirect,
    direct_current::InverseDirect,
    inverse_network::InverseNetwork,
    active::Active,
}

impl Law {
    /// The law of that name.
    #[must_use]
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|law| law.spec().name == name)
    }
}

/// How each device is elongated when the ground alone moves back by 1 m: e r.
pub(crate) fn ground_reach(devices: &SparseRows, influence: &[f64]) -> Vec<f64> {
    (0..devices.len()).map(|device| devices.dot(device, influence)).collect()
}

/// `yes` where a number is above zero, else zero; not a number where it is none.
#[inline(always)]
fn where_positive<R: Real>(number: R, yes: R) -> R {
    let otherwise = if_known(number, R::splat(0.0));
    R::select(R::splat(0.0).less(number), yes, otherwise)
}

/// `value`, but not a number where `by`, which it was chosen by, is none: a comparison would hide it.
#[inline(always)]
fn if_known<R: Real>(by: R, value: R) -> R {
    R::select(by.equal(by), value, R::splat(f64::NAN))
}

/// A number cut off below and above.
#[inline(always)]
pub(crate) fn within<R: Real>(number: R, lower: R, upper: R) -> R {
    let from_below = R::select(number.less(lower), lower, number);
    R::select(upper.less(from_below), upper, from_below)
}
