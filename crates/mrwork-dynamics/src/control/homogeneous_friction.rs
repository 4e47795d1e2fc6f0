//! Modulated homogeneous friction: a friction force in proportion to the last peak of the deformation.

use super::law::{ControlLaw, Memory};
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;
use crate::real::where_positive;

/// On while the force is below the friction desired at the last peak.
pub struct ModulatedHomogeneousFriction;

impl ControlLaw for ModulatedHomogeneousFriction {
    const SPEC: LawSpec = LawSpec {
        name: "modulated_homogeneous_friction",
        title: "Modulated homogeneous friction",
        equation: "i = i_max H(g |d_p| - |f|), d_p the deformation at its last peak",
        description: "A friction force in proportion to the last peak of the deformation, so that the damping \
                      ratio does not depend on the amplitude. A peak is where the rate changes sign between two \
                      samples.",
        source: "Inaudi, Earthquake Eng. Struct. Dyn. 26(3), 1997, 361-376",
        gains: &[GainSpec {
            name: "slope",
            unit: Unit::Of("N/m"),
            shape: Shape::Device,
            description: "g, desired friction force per deformation at the last peak",
        }],
        tables: &[],
        memory: 3,
        needs_curve: false,
        needs_model: false,
        commands_force: false,
        reads_acceleration: false,
        takes_signals: false,
        switches: true,
    };

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Memory<'_, R>,
        command: &mut [R],
    ) {
        for (device, (command, memory)) in
            command.iter_mut().zip(memory.numbers.chunks_exact_mut(3)).enumerate()
        {
            let [last_rate, last_deformation, peak] = memory else { continue };
            let turned = (*last_rate * measured.rate[device]).less(R::splat(0.0));
            *peak = R::select(turned, last_deformation.abs(), *peak);
            *last_rate = measured.rate[device];
            *last_deformation = measured.deformation[device];
            let missing = gains.of_device(0, device).mul_add(*peak, -measured.force[device].abs());
            *command = where_positive(missing, R::splat(measured.largest[device]));
        }
    }
}
