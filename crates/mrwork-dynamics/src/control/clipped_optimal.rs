//! Clipped-optimal control: the damper follows the force of a linear regulator as far as it can.

use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;
use crate::real::{Real, where_positive};

pub(super) const GAIN: GainSpec = GainSpec {
    name: "gain",
    unit: Unit::Of("N"),
    shape: Shape::State,
    description: "K of the desired resisting force f_c = -K s",
};
const FULL_FORCE: GainSpec = GainSpec {
    name: "full_force",
    unit: Unit::Of("N"),
    shape: Shape::Device,
    description: "desired force at which the command is the largest",
};

/// Zero or the largest command.
pub struct ClippedOptimal;

impl Formula for ClippedOptimal {
    const SPEC: LawSpec = LawSpec {
        name: "clipped_optimal",
        title: "Clipped-optimal",
        equation: "i = i_max H((f_c - f) f), f_c = -K s",
        description: "Full command where the damper force has the direction of the desired force and is smaller. \
                      Needs the measured force. It may switch at every sample, so results hold for the stated \
                      sample time.",
        source: "Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575",
        gains: &[GAIN],
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let desired = -gains.of_state(0, device, measured);
            *command = clipped(desired, measured.force[device], R::splat(measured.largest[device]));
        }
    }
}

/// `command` if the damper resists in the desired direction and less than desired, else zero.
#[inline(always)]
pub(super) fn clipped<R: Real>(desired: R, force: R, command: R) -> R {
    where_positive((desired - force) * force, command)
}

/// Command in proportion to the desired force.
pub struct ModifiedClippedOptimal;

impl Formula for ModifiedClippedOptimal {
    const SPEC: LawSpec = LawSpec {
        name: "modified_clipped_optimal",
        title: "Modified clipped-optimal",
        equation: "i = i_max min(|f_c|/f_full, 1) H((f_c - f) f), f_c = -K s",
        description: "The clipped-optimal law with a command in proportion to the desired force.",
        source: "Yoshida, Dyke, J. Eng. Mech. 130(4), 2004",
        gains: &[GAIN, FULL_FORCE],
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let desired = -gains.of_state(0, device, measured);
            let share = (desired.abs() / gains.of_device(1, device)).min(R::splat(1.0));
            *command = clipped(desired, measured.force[device], share * R::splat(measured.largest[device]));
        }
    }
}

/// Command in proportion to the missing force.
pub struct ProportionalClippedOptimal;

/// Missing force, as a share of the full force, at which the largest command is sent.
const BAND: f64 = 0.1;

impl Formula for ProportionalClippedOptimal {
    const SPEC: LawSpec = LawSpec {
        name: "proportional_clipped_optimal",
        title: "Proportional clipped-optimal",
        equation: "i = i_max min(|f_c - f|/(0.1 f_full), 1) H((f_c - f) f), f_c = -K s",
        description: "The clipped-optimal law with a command in proportion to the difference between desired and \
                      measured force; smooth where the damper follows.",
        source: "our definition",
        gains: &[GAIN, FULL_FORCE],
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let desired = -gains.of_state(0, device, measured);
            let missing = (desired - measured.force[device]).abs();
            let share = (missing / (R::splat(BAND) * gains.of_device(1, device))).min(R::splat(1.0));
            *command = clipped(desired, measured.force[device], share * R::splat(measured.largest[device]));
        }
    }
}
