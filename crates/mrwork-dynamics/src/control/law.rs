//! The trait of control laws, and what a law keeps from sample to sample.

use super::measurement::Measurement;
use super::rollout::Planner;
use super::signals::Further;
use super::spec::{Gains, LawSpec};
use crate::error::DynamicsError;
use crate::lanes::Lanes;

/// What a law keeps from sample to sample.
pub(crate) struct Memory<'a, R: Lanes> {
    /// Numbers of each device.
    pub(crate) numbers: Vec<R>,
    /// The further signals.
    pub(crate) further: Further<'a, R>,
    /// The rollout of a law that predicts the motion.
    pub(crate) plan: Option<Box<Planner<'a, R>>>,
}

/// A control law: its formula, written once over `R: Lanes`.
///
/// `command` must be `#[inline(always)]`: it runs inside a function compiled for each instruction set.
pub(super) trait ControlLaw {
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
