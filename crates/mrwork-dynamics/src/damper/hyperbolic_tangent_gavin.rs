//! Hyperbolic tangent model of Gavin (2001).

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::elementary::tanh;
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    f_o: "N", Log, 1e-3 .. 1e9, nominal 700.0, "yield force";
    V_r: "m/s", Log, 1e-7 .. 1e2, nominal 0.03, "velocity over which the damper yields";
    d_r: "m", Log, 1e-7 .. 1e2, nominal 0.02, "displacement equivalent to V_r; it opens the loop over velocity";
    k0: "N/m", Linear, -1e9 .. 1e9, nominal 1500.0, "stiffness in parallel";
    c0: "N s/m", Log, 1e-3 .. 1e9, nominal 2500.0, "viscous damping";
    f0: "N", Offset, -1e8 .. 1e8, nominal 40.0, "force offset";
    => per_V_r of V_r: R = R::splat(1.0) / V_r;
    per_d_r of d_r: R = R::splat(1.0) / d_r;
}

/// A yield force that depends on velocity and displacement together.
#[derive(Clone, Copy)]
pub struct HyperbolicTangentGavin;

impl DamperModel for HyperbolicTangentGavin {
    const SPEC: DamperSpec = DamperSpec {
        name: "hyperbolic_tangent_gavin",
        title: "Hyperbolic tangent (Gavin)",
        equation: "f = f_o tanh(v/V_r + x/d_r) + k0 x + c0 v + f0",
        description: "No internal state and few parameters; suited to loops about a fixed mid-stroke. The width \
                      of the loop over velocity, 2 x V_r/d_r at the turning point, grows with the amplitude. \
                      Limitation: the hysteresis depends on x and not on the last reversal, so a static offset \
                      of x acts as a force, and small cycles away from x = 0 have the wrong loop. f_o is the \
                      yield force; f0 is an offset that the published model lacks.",
        source: "Gavin, J. Intell. Mater. Syst. Struct. 12(5), 2001, 353-366",
        nominal_source: "our own, typical of a small damper of 1-3 kN; not verified against a record",
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
        let Motion { displacement: x, velocity: v } = motion;
        let hysteresis = tanh(v.mul_add(p.per_V_r, x * p.per_d_r));
        p.c0.mul_add(v, p.k0.mul_add(x, p.f_o.mul_add(hysteresis, p.f0)))
    }

    #[inline(always)]
    fn stiffness_bound(_: &Parameters<f64>, _: Severity) -> f64 {
        0.0
    }
}
