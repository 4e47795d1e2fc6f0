//! Lyapunov control: the command that makes V = s'Ps/2 fall fastest, on or off.

use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;
use crate::real::where_positive;

pub(super) const WEIGHT: GainSpec = GainSpec {
    name: "weight",
    unit: Unit::Of("1/s per N, times any factor"),
    shape: Shape::State,
    description: "P B of each device: sigma = s'P B is the derivative of V' with respect to the force",
};

/// On or off by the sign of sigma f.
pub struct Lyapunov;

impl Formula for Lyapunov {
    const SPEC: LawSpec = LawSpec {
        name: "lyapunov",
        title: "Lyapunov",
        equation: "i = i_max H(-sigma f), sigma = s'P B, A'P + P A = -Q",
        description: "Full command where the damper force reduces V = s'Ps/2. Needs the measured force.",
        source: "Jansen, Dyke, J. Eng. Mech. 126(8), 2000, 795-803",
        gains: &[WEIGHT],
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let sigma = gains.of_state(0, device, measured);
            *command = where_positive(-sigma * measured.force[device], R::splat(measured.largest[device]));
        }
    }
}
