//! The traits of control laws.

use super::measurement::Measurement;
use super::rollout::Planner;
use super::spec::{Gains, LawSpec};
use crate::error::DynamicsError;
use crate::lanes::Lanes;

/// What a loop has before its first sample.
pub(crate) struct Beginning<'a, R: Lanes> {
    /// Number of devices.
    pub(crate) n_devices: usize,
    /// The rollout of a law that predicts the motion.
    pub(crate) plan: Option<Box<Planner<'a, R>>>,
}

/// Numbers that a law keeps from sample to sample.
pub(crate) trait Kept<R> {
    /// Visits each.
    fn each(&mut self, visit: &mut dyn FnMut(&mut R));
}

impl<R> Kept<R> for () {
    fn each(&mut self, _: &mut dyn FnMut(&mut R)) {}
}

/// A control law: its formula, written once over `R: Lanes`, and what it keeps from sample to sample.
///
/// `command` must be `#[inline(always)]`: it runs inside a function compiled for each instruction set.
pub(crate) trait ControlLaw {
    /// Name, prose, gains.
    const SPEC: LawSpec;

    /// What it keeps from sample to sample, by name.
    type Memory<'a, R: Lanes>: Kept<R>;

    /// Its memory before the first sample.
    fn start<R: Lanes>(beginning: Beginning<'_, R>) -> Self::Memory<'_, R>;

    /// Commands of all devices; the caller limits them to the admitted range.
    ///
    /// A command must not be a number if one of its inputs is not a number: the caller then sends zero.
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Self::Memory<'_, R>,
        command: &mut [R],
    );

    /// Refuses tables of the wrong size.
    fn check_tables(_: &[Vec<f64>]) -> Result<(), DynamicsError> {
        Ok(())
    }
}

/// A control law without memory; its items are those of [`ControlLaw`].
pub(crate) trait Formula {
    /// Name, prose, gains.
    const SPEC: LawSpec;

    /// Commands of all devices.
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]);

    /// Refuses tables of the wrong size.
    fn check_tables(_: &[Vec<f64>]) -> Result<(), DynamicsError> {
        Ok(())
    }
}

impl<L: Formula> ControlLaw for L {
    const SPEC: LawSpec = L::SPEC;

    type Memory<'a, R: Lanes> = ();

    fn start<R: Lanes>(_: Beginning<'_, R>) -> Self::Memory<'_, R> {}

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        (): &mut Self::Memory<'_, R>,
        command: &mut [R],
    ) {
        L::command(gains, measured, command);
    }

    fn check_tables(tables: &[Vec<f64>]) -> Result<(), DynamicsError> {
        L::check_tables(tables)
    }
}
