//! Ideal active control: the force of a linear regulator without limits.

use super::clipped_optimal::GAIN;
use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{Gains, LawSpec};
use crate::lanes::Lanes;

/// The desired force itself, for a device that can give any force.
pub struct Active;

impl Formula for Active {
    const SPEC: LawSpec = LawSpec {
        name: "active",
        title: "Ideal active force",
        equation: "f = f_c = -K s",
        description: "The bound of every semi-active law: the command is a force in newtons, for the device \
                      `ideal_actuator`, which may also add energy to the building.",
        source: "linear quadratic regulator",
        gains: &[GAIN],
        commands_force: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            *command = -gains.of_state(0, device, measured);
        }
    }
}
