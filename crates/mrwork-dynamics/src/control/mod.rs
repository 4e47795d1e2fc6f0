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
mod law;
mod loop_model;
mod lyapunov;
mod maximum_energy_dissipation;
mod measurement;
mod passive;
mod predictive_rollout;
mod rollout;
mod signal_network;
mod skyhook_groundhook;
mod sliding_mode;
mod spec;

pub use force_curve::CurveModel;
pub(crate) use force_curve::ForceCurve;
pub(crate) use law::Beginning;
use law::{ControlLaw, Kept};
pub use loop_model::LoopModel;
pub(crate) use measurement::{Measurement, Preview, ground_reach};
pub(crate) use predictive_rollout::Rollout;
pub use rollout::RolloutText;
pub(crate) use rollout::{Timing, plan, reads_accelerations};
pub(crate) use spec::Gains;
pub use spec::{GainSpec, LawSpec, LoopSizes, Shape, Unit};

use crate::error::DynamicsError;
use crate::lanes::Lanes;

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

            /// Its memory before the first sample.
            pub(crate) fn start<R: Lanes>(self, beginning: Beginning<'_, R>) -> Memory<'_, R> {
                match self { $(Self::$law => Memory::$law(<$module::$law as ControlLaw>::start(beginning)),)+ }
            }

            pub(crate) fn check_tables(self, tables: &[Vec<f64>]) -> Result<(), DynamicsError> {
                match self { $(Self::$law => <$module::$law as ControlLaw>::check_tables(tables),)+ }
            }
        }

        /// A law in a loop, with what it keeps from sample to sample.
        pub(crate) enum Memory<'a, R: Lanes> { $($law(<$module::$law as ControlLaw>::Memory<'a, R>),)+ }

        impl<R: Lanes> Memory<'_, R> {
            /// Visits each number that it keeps.
            pub(crate) fn each(&mut self, visit: &mut dyn FnMut(&mut R)) {
                match self { $(Self::$law(memory) => memory.each(visit),)+ }
            }

            /// Commands at a sample. With derivatives a law that switches is not compiled, and sends nothing.
            #[inline(always)]
            pub(crate) fn command(
                &mut self, gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R],
            ) {
                match self {
                    $(Self::$law(memory) => if const { !R::HAS_DERIVATIVES || !<$module::$law as ControlLaw>::SPEC.switches } {
                        <$module::$law as ControlLaw>::command(gains, measured, memory, command);
                    })+
                }
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
    signal_network::SignalNetwork,
    active::Active,
    acceleration_driven::AccelerationDriven,
    acceleration_driven::MixedSkyhook,
    skyhook_groundhook::SkyhookGroundhook,
    predictive_rollout::PredictiveRollout,
}

impl Law {
    /// The law of that name.
    #[must_use]
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|law| law.spec().name == name)
    }
}
