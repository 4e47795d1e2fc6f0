//! Maximum energy dissipation: the command that takes most energy out of the relative motion.

use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{Gains, LawSpec};
use crate::lanes::Lanes;
use crate::real::where_positive;

/// On or off by the sign of relative velocity times force.
pub struct MaximumEnergyDissipation;

impl Formula for MaximumEnergyDissipation {
    const SPEC: LawSpec = LawSpec {
        name: "maximum_energy_dissipation",
        title: "Maximum energy dissipation",
        equation: "i = i_max H(e q' f)",
        description: "Full command while the device dissipates energy. A damper nearly always does, so the law \
                      is close to passive-on.",
        source: "Jansen, Dyke, J. Eng. Mech. 126(8), 2000, 795-803",
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(_: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            *command = where_positive(
                measured.rate[device] * measured.force[device],
                R::splat(measured.largest[device]),
            );
        }
    }
}
