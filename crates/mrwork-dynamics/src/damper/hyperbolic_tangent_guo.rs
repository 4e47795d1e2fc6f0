//! Hyperbolic tangent model of Guo, Yang and Pan (2006).

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::elementary::tanh;
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    A1: "N", Log, 1e-3 .. 1e9, nominal 700.0, "yield force";
    A2: "N s/m", Log, 1e-3 .. 1e9, nominal 2500.0, "viscous damping";
    A3: "s/m", Log, 1e-3 .. 1e7, nominal 30.0, "steepness of the hysteresis over velocity";
    omega: "1/s", Log, 1e-3 .. 1e6, nominal 2.0, "half width of the hysteresis over velocity, per displacement";
    f0: "N", Offset, -1e8 .. 1e8, nominal 40.0, "force offset";
}

/// One shifted velocity drives both the yield force and the dashpot.
#[derive(Clone, Copy)]
pub struct HyperbolicTangentGuo;

impl DamperModel for HyperbolicTangentGuo {
    const SPEC: DamperSpec = DamperSpec {
        name: "hyperbolic_tangent_guo",
        title: "Hyperbolic tangent (Guo)",
        equation: "f = A1 tanh(A3 (v + omega x)) + A2 (v + omega x) + f0",
        description: "No internal state and five parameters. The published model writes V0/X0 for omega; the \
                      force depends on the quotient only, so it is one parameter here, and it is no frequency of \
                      the motion. It is the model of Gavin with k0 = A2 omega: the stiffness is tied to the \
                      width of the loop, which need not hold for a gas accumulator. Its limitation is the same: \
                      the hysteresis depends on x and not on the last reversal.",
        source: "Guo, Yang, Pan, J. Intell. Mater. Syst. Struct. 17(1), 2006, 3-14",
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
        let shifted = p.omega.mul_add(motion.displacement, motion.velocity);
        p.A1.mul_add(tanh(p.A3 * shifted), p.A2.mul_add(shifted, p.f0))
    }

    #[inline(always)]
    fn stiffness_bound(_: &Parameters<f64>, _: Severity) -> f64 {
        0.0
    }
}
