//! A constant command: passive off, passive on, and all between.

use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;

/// The same command throughout.
pub struct Passive;

impl Formula for Passive {
    const SPEC: LawSpec = LawSpec {
        name: "passive",
        title: "Constant command",
        equation: "i = i_0",
        description: "Passive-off for a command of zero, passive-on for the largest. The best constant command \
                      is the baseline for semi-active laws.",
        source: "Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575",
        gains: &[GainSpec {
            name: "command",
            unit: Unit::Command,
            shape: Shape::Device,
            description: "the constant command",
        }],
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, _: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            *command = gains.of_device(0, device);
        }
    }
}
