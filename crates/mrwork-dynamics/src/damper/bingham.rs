//! Bingham model of Stanway, Sproston and Stevens (1987).

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::elementary::tanh;
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    f_c: "N", Log, 1e-3 .. 1e9, nominal 670.0, "yield force";
    v_s: "m/s", Log, 1e-7 .. 1e2, nominal 5e-3, "velocity over which the yield force changes sign";
    c0: "N s/m", Log, 1e-3 .. 1e9, nominal 5000.0, "viscous damping";
    f0: "N", Offset, -1e8 .. 1e8, nominal -95.0, "force offset";
    => per_v_s of v_s: R = R::splat(1.0) / v_s;
}

/// Smoothed Coulomb friction in parallel with a dashpot.
#[derive(Clone, Copy)]
pub struct Bingham;

impl DamperModel for Bingham {
    const SPEC: DamperSpec = DamperSpec {
        name: "bingham",
        title: "Bingham",
        equation: "f = f_c tanh(v/v_s) + c0 v + f0",
        description: "A yield force and a dashpot: sufficient for the energy of a cycle and for a first estimate \
                      of a control law. The force depends on the velocity alone, so there is no hysteresis over \
                      velocity and no stiffness before yield. The published model has sgn(v) in place of \
                      tanh(v/v_s); the two agree as v_s goes to zero. On a record of a real damper the \
                      identified v_s is large, because it has to represent the loop that the model lacks.",
        source: "Stanway, Sproston, Stevens, J. Electrostat. 20(2), 1987, 167-184",
        nominal_source: "Spencer et al. 1997, at 1.5 V (published, not independently verified); v_s is our own",
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
        p.f_c.mul_add(tanh(v * p.per_v_s), p.c0.mul_add(v, p.f0))
    }

    #[inline(always)]
    fn stiffness_bound(_: &Parameters<f64>, _: Severity) -> f64 {
        0.0
    }
}
