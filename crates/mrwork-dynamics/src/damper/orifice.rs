//! Orifice damper: a loss of head that grows with the square of the velocity.

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    d: "N s2/m2", Log, 1e-3 .. 1e12, nominal 2e5, "loss of head in the orifice";
    c: "N s/m", Log, 1e-3 .. 1e9, nominal 2000.0, "viscous damping of bypass and seals";
    f0: "N", Offset, -1e8 .. 1e8, nominal 20.0, "force offset";
}

/// Turbulent flow through an orifice in parallel with a dashpot.
#[derive(Clone, Copy)]
pub struct Orifice;

impl DamperModel for Orifice {
    const SPEC: DamperSpec = DamperSpec {
        name: "orifice",
        title: "Orifice",
        equation: "f = d |v| v + c v + f0",
        description: "A hydraulic damper whose liquid is forced through an orifice. With a law of the valve on d it \
                      is the variable-orifice damper of semi-active control, and across the stroke of a liquid \
                      column its controllable valve. No yield force and no hysteresis: it is not a model of a \
                      magnetorheological fluid.",
        source: "Symans, Constantinou, J. Eng. Mech. 123(12), 1997, 1293-1303, who have a power of the velocity \
                 and a fluid restoring force beside; this form is the limit of turbulent flow",
        nominal_source: "our own choice at the scale of a five-storey frame of 1.7 t (not verified)",
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
    fn force<R: Real>(p: &Parameters<R>, _: [R; 0], motion: Motion<R>) -> R {
        let v = motion.velocity;
        v.mul_add(p.d.mul_add(v.abs(), p.c), p.f0)
    }

    #[inline(always)]
    fn stiffness_bound(_: &Parameters<f64>, _: Severity) -> f64 {
        0.0
    }
}
