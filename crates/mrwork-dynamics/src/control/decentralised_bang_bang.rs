//! Decentralised bang-bang control: the command that takes most energy out of the building's absolute motion.

use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{Gains, LawSpec};
use crate::lanes::Lanes;
use crate::real::where_positive;

/// On or off by the sign of absolute velocity times force.
pub struct DecentralisedBangBang;

impl Formula for DecentralisedBangBang {
    const SPEC: LawSpec = LawSpec {
        name: "decentralised_bang_bang",
        title: "Decentralised bang-bang",
        equation: "i = i_max H(x' f), x = e (q + r u_g), or of the sprung mass",
        description: "Full command where the force opposes the absolute motion of the floors to which the device \
                      is attached. Each device needs its own motion and force, and the motion of the ground if \
                      it is attached to it; with a sprung mass, the absolute motion of that.",
        source: "Jansen, Dyke, J. Eng. Mech. 126(8), 2000, 795-803",
        reads_sprung: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(_: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            *command = where_positive(
                measured.absolute_rate(device) * measured.force[device],
                R::splat(measured.largest[device]),
            );
        }
    }
}
