//! Elasto-visco-plastic model: a spring in series with a core that yields smoothly.

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::elementary::exp;
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    f_y: "N", Log, 1e-3 .. 1e9, nominal 700.0, "yield force of the core";
    v_r: "m/s", Log, 1e-6 .. 10.0, nominal 0.02, "velocity over which the core yields: rounds the knee over velocity";
    c: "N s/m", Log, 1e-3 .. 1e9, nominal 1800.0, "viscous damping of the core beyond yield";
    rho: "1/m", Log, 1e-2 .. 1e7, nominal 5700.0, "spring in series divided by f_y: the loop yields within about 1/rho of travel";
    r: "1/s", Log, 1e-6 .. 1e4, nominal 5.0, "creep: rate at which the spring force relaxes while the damper is held";
    k: "N/m", Linear, -1e9 .. 1e9, nominal 1500.0, force_only, "stiffness in parallel, of the accumulator";
    f0: "N", Offset, -1e8 .. 1e8, nominal 40.0, force_only, "force offset";
    => decay of v_r: R = R::splat(-2.0) / v_r;
    spring of rho, f_y: R = rho * f_y;
    yielding of f_y, v_r: R = R::splat(4.0) * f_y / v_r;
}

/// A series spring and a visco-plastic core; the state is the velocity of the core.
#[derive(Clone, Copy)]
pub struct ElastoViscoPlastic;

impl DamperModel for ElastoViscoPlastic {
    const SPEC: DamperSpec = DamperSpec {
        name: "elasto_visco_plastic",
        title: "Elasto-visco-plastic",
        equation: "f = q(u) + k x + f0\n\
                   q(u) = f_y tanh(u/v_r) + c u\n\
                   u' = (rho f_y (v - u) - r q(u)) / q'(u)",
        description: "The fluid yields over a velocity v_r, in series with a spring rho f_y (elasticity of \
                      fluid, seals and mounts); u is the velocity of the core. Round knees over velocity, \
                      hysteresis that grows with frequency, few parameters: suited to fast and broad-band tests. \
                      r = rho f_y/c_k represents a creep dashpot c_k in series; tests much shorter than 1/r do \
                      not determine it. If c is small against f_y/v_r, the core yields abruptly, which needs \
                      many sub-steps.",
        source: "Maxwell element with the viscoplastic core of Stanway, Sproston, Stevens, J. Electrostatics 20, \
                 1987, 167-184, smoothed; this form is our own",
        nominal_source: "our own choice at the scale of an RD-1005-3 at 1 A (not verified)",
        parameters: PARAMETERS,
        n_states: 1,
        odd: true,
        offset_adds: true,
        relaxes: true,
        spring: None,
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 1];

    #[inline(always)]
    fn rate<R: Real>(p: &Parameters<R>, [u]: [R; 1], motion: Motion<R>) -> [R; 1] {
        // Numerator and denominator of u' times (1 + e)^2, so that there is one division.
        let Core { e, one_plus_e, flow } = core(p, u);
        let driven = (-p.r).mul_add(flow, p.spring * (motion.velocity - u) * one_plus_e);
        let slope = p.yielding.mul_add(e, p.c * one_plus_e * one_plus_e);
        [driven * one_plus_e / slope]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, [u]: [R; 1], motion: Motion<R>) -> R {
        let Core { one_plus_e, flow, .. } = core(p, u);
        p.k.mul_add(motion.displacement, flow / one_plus_e + p.f0)
    }

    /// The spring force relaxes at `k_s/q' + r`, `k_s = rho f_y`, fastest where the core is fastest, at |u| = |v|.
    ///
    /// While the core yields, u grows at the rate u' |q''|/q', at most `k_s (v - u)/(2 c v_r)`, reached where
    /// `f_y/v_r sech^2(u/v_r) = c`; v there follows from the acceleration after a reversal over the travel that reverses
    /// the spring force, 2/rho.
    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        let Severity { peak_velocity, reversal_acceleration } = loading;
        let stiffness = p.rho * p.f_y;
        let steepness = p.f_y / p.v_r;
        let slope = p.c + steepness / (peak_velocity / p.v_r).cosh().powi(2);
        let knee = p.v_r * (steepness / p.c).max(1.0).sqrt().acosh();
        let turned = (4.0 * reversal_acceleration / p.rho).sqrt().min(peak_velocity);
        let giving_way = stiffness * (turned - knee).max(0.0) / (2.0 * p.c * p.v_r);
        (stiffness / slope + p.r).max(giving_way)
    }
}

/// The core in terms of `e = exp(-2 |u|/v_r)`: tanh is (1 - e)/(1 + e), and sech^2 = 4 e/(1 + e)^2 stays accurate where
/// 1 - tanh^2 cancels, which matters for a small c.
struct Core<R> {
    e: R,
    one_plus_e: R,
    /// q(u) (1 + e).
    flow: R,
}

#[inline(always)]
fn core<R: Real>(p: &Parameters<R>, u: R) -> Core<R> {
    let one = R::splat(1.0);
    let e = exp(u.abs() * p.decay);
    let one_plus_e = one + e;
    let yielded = p.f_y * (one - e).copysign(u);
    Core { e, one_plus_e, flow: (p.c * u).mul_add(one_plus_e, yielded) }
}
