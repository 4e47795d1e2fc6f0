//! Modulated homogeneous friction: a friction force in proportion to the last peak of the deformation.

use super::law::{Beginning, ControlLaw, Kept};
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;
use crate::real::where_positive;

/// What a device did at the sample before, and the deformation of its last peak; all zero before the first sample.
#[derive(Clone)]
pub(crate) struct LastPeak<R> {
    rate: R,
    deformation: R,
    peak: R,
}

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
        switches: true,
        ..LawSpec::PLAIN
    };

    type Memory<'a, R: Lanes> = Vec<LastPeak<R>>;

    fn start<R: Lanes>(Beginning { n_devices, .. }: Beginning<'_, R>) -> Self::Memory<'_, R> {
        let zero = R::splat(0.0);
        vec![LastPeak { rate: zero, deformation: zero, peak: zero }; n_devices]
    }

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Self::Memory<'_, R>,
        command: &mut [R],
    ) {
        for (device, (command, last)) in command.iter_mut().zip(memory).enumerate() {
            let turned = (last.rate * measured.rate[device]).less(R::splat(0.0));
            last.peak = R::select(turned, last.deformation.abs(), last.peak);
            last.rate = measured.rate[device];
            last.deformation = measured.deformation[device];
            let missing = gains.of_device(0, device).mul_add(last.peak, -measured.force[device].abs());
            *command = where_positive(missing, R::splat(measured.largest[device]));
        }
    }
}

impl<R> Kept<R> for Vec<LastPeak<R>> {
    fn each(&mut self, visit: &mut dyn FnMut(&mut R)) {
        for own in self {
            visit(&mut own.rate);
            visit(&mut own.deformation);
            visit(&mut own.peak);
        }
    }
}
