//! An ideal actuator: the force equals the command. Not a damper, but a device of a closed loop.

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    f: "N", Linear, -1e300 .. 1e300, nominal 0.0, "resisting force, which follows the command";
}

/// The device of the law `active`. Not in the registry of dampers.
#[derive(Clone, Copy)]
pub struct IdealActuator;

impl DamperModel for IdealActuator {
    const SPEC: DamperSpec = DamperSpec {
        name: "ideal_actuator",
        title: "Ideal actuator",
        equation: "f = u",
        description: "Exerts the commanded force, in newtons, at once, and may add energy to the building.",
        source: "the bound of every semi-active law",
        nominal_source: "none",
        parameters: PARAMETERS,
        n_states: 0,
        odd: true,
        offset_adds: true,
        relaxes: false,
        spring: None,
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 0];

    #[inline(always)]
    fn rate<R: Real>(_: &Parameters<R>, state: [R; 0], _: Motion<R>) -> [R; 0] {
        state
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, _: [R; 0], _: Motion<R>) -> R {
        p.f
    }

    #[inline(always)]
    fn stiffness_bound(_: &Parameters<f64>, _: Severity) -> f64 {
        0.0
    }
}
