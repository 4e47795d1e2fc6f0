//! Acceleration-driven damping: the command that takes most out of the absolute acceleration, alone and mixed with skyhook.
//!
//! A vehicle's body is the sprung mass of the device. Without one it is in a building the floor above the device, or for a
//! device between floors the upper floor with respect to the lower one: `x = e (q + r u_g)`, whose rate is that of the
//! device but for the ground.

use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;
use crate::real::where_positive;

/// On or off by the sign of absolute acceleration times damper velocity.
pub struct AccelerationDriven;

impl Formula for AccelerationDriven {
    const SPEC: LawSpec = LawSpec {
        name: "acceleration_driven",
        title: "Acceleration-driven damping",
        equation: "i = i_max H(x'' d'), x'' = e (q'' + r a_g) or that of the sprung mass, d' = e q'",
        description: "Full command where the damper force opposes the absolute acceleration of the floor to which the \
                      device is attached, or the difference of those of two floors: of all commands the one that \
                      makes their sum of squares, weighted by mass, smallest at the next instant. Needs \
                      accelerometers at the ends of each device, and no model of the building. Good above the \
                      crossover frequency of the mixed law, weak at resonance. It may switch at every sample.",
        source: "Savaresi, Silani, Bittanti, J. Dyn. Syst. Meas. Control 127(2), 2005, 218-229",
        reads_acceleration: true,
        reads_sprung: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(_: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            *command = where_positive(
                measured.absolute_acceleration(device) * measured.rate[device],
                R::splat(measured.largest[device]),
            );
        }
    }
}

/// Skyhook below a crossover frequency, acceleration-driven damping above.
pub struct MixedSkyhook;

impl Formula for MixedSkyhook {
    const SPEC: LawSpec = LawSpec {
        name: "mixed_skyhook",
        title: "Mixed skyhook and acceleration-driven damping",
        equation: "i = i_max H(y d'), y = x' where |x''| <= a |x'|, else x''; x = e (q + r u_g) or that of the sprung \
                   mass, d' = e q'",
        description: "Skyhook, on where absolute velocity and damper velocity have one sign, while the motion is slow, \
                      and acceleration-driven damping while it is fast: the sign of x''^2 - a^2 x'^2 tells which, with \
                      the crossover a between the two. Needs accelerometers at the ends of each device and their \
                      absolute velocity, and no model of the building. An infinite crossover is skyhook alone.",
        source: "Savaresi, Spelta, J. Dyn. Syst. Meas. Control 129(4), 2007, 382-392",
        gains: &[GainSpec {
            name: "crossover",
            unit: Unit::Of("rad/s"),
            shape: Shape::Device,
            description: "frequency a below which the law is skyhook",
        }],
        reads_acceleration: true,
        reads_sprung: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let velocity = measured.absolute_rate(device);
            let acceleration = measured.absolute_acceleration(device);
            let slow = velocity.abs() * gains.of_device(0, device);
            // A velocity that is not a number is in the sum, an acceleration also in what is chosen.
            let chosen = R::select(slow.less(acceleration.abs()), acceleration, velocity);
            let known = chosen + (velocity + acceleration) * R::splat(0.0);
            *command = where_positive(known * measured.rate[device], R::splat(measured.largest[device]));
        }
    }
}
