//! Skyhook and groundhook: damping of the absolute motion of a vehicle's body and of its wheel, in shares.

use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;
use crate::real::where_positive;

/// Skyhook for the sprung mass and groundhook for the unsprung one, in shares.
pub struct SkyhookGroundhook;

impl Formula for SkyhookGroundhook {
    const SPEC: LawSpec = LawSpec {
        name: "skyhook_groundhook",
        title: "Skyhook and groundhook",
        equation: "i = i_max (a H(x' d') + (1 - a) H(-w' d')), x' of the sprung mass, d' = e q', w' = x' - d'",
        description: "On-off skyhook, which damps the absolute motion of the sprung mass x, and groundhook, which damps \
                      that of the unsprung mass w at the other end, in the shares a and 1 - a of the command. Needs the \
                      absolute velocity of the sprung mass, and no model of the vehicle.",
        source: "Ahmadian, Pare, J. Intell. Mater. Syst. Struct. 11(8), 2000, 604-612",
        gains: &[GainSpec {
            name: "share",
            unit: Unit::Of("1"),
            shape: Shape::Device,
            description: "share a of skyhook; the rest is groundhook",
        }],
        reads_sprung: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let (sprung, rate) = (measured.absolute_rate(device), measured.rate[device]);
            let share = gains.of_device(0, device);
            let skyhook = where_positive(sprung * rate, share);
            let groundhook = where_positive((rate - sprung) * rate, R::splat(1.0) - share);
            *command = (skyhook + groundhook) * R::splat(measured.largest[device]);
        }
    }
}
