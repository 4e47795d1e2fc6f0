//! Modified `LuGre` model of Jimenez and Alvarez-Icaza (2005).

use super::model::{DamperModel, DamperSpec, Motion, Severity, Short};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    sigma_0: "N/m", Log, 1e-3 .. 1e12, nominal 2.1e6, force_only, "stiffness of the bristles: the loop lies between +-sigma_0/a0";
    sigma_1: "N s/m", Log, 1e-3 .. 1e9, nominal 2000.0, force_only, "damping of the bristles; it acts just after a reversal only";
    sigma_2: "N s/m", Log, 1e-3 .. 1e9, nominal 2500.0, force_only, "viscous damping";
    a0: "1/m", Log, 1e-2 .. 1e7, nominal 3000.0, "inverse of the largest deflection of the bristles";
    f0: "N", Offset, -1e8 .. 1e8, nominal 40.0, force_only, "force offset";
}

/// Friction as the bending of bristles.
#[derive(Clone, Copy)]
pub struct LuGre;

impl DamperModel for LuGre {
    const SHORT: Short = Short::Always;
    const SPEC: DamperSpec = DamperSpec {
        name: "lugre",
        title: "LuGre (modified)",
        equation: "f = sigma_0 z + sigma_1 z' + sigma_2 v + f0\n\
                   z' = v - a0 |v| z",
        description: "viscous_dahl with z = w/a0 and a damping of the bristles in parallel; passive under any \
                      motion except for f0. Modified: the friction of the original falls as the speed grows \
                      (Stribeck effect), which MR dampers do not show; here it does not. The published force has \
                      two more terms, sigma_0 z V and sigma_b v V with the voltage V: linear laws of the current \
                      on sigma_0 and sigma_2, whose constant parts are called sigma_a and sigma_2 there. \
                      Consider the yield force sigma_0/a0 when you set bounds: sigma_0 and a0 alone say little.",
        source: "Jimenez, Alvarez-Icaza, Struct. Control Health Monit. 12(1), 2005, 91-116; \
                 after Canudas de Wit et al., IEEE Trans. Autom. Control 40(3), 1995, 419-425",
        nominal_source: "our own, typical of a small damper of 1-3 kN; not verified against a record",
        parameters: PARAMETERS,
        n_states: 1,
        odd: true,
        offset_adds: true,
        relaxes: false,
        spring: None,
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 1];

    #[inline(always)]
    fn rate<R: Real>(p: &Parameters<R>, [z]: [R; 1], motion: Motion<R>) -> [R; 1] {
        let v = motion.velocity;
        [(-p.a0 * v.abs()).mul_add(z, v)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, state: [R; 1], motion: Motion<R>) -> R {
        let ([z], [z_rate]) = (state, Self::rate(p, state, motion));
        let bristles = p.sigma_0.mul_add(z, p.sigma_1 * z_rate);
        p.sigma_2.mul_add(motion.velocity, bristles + p.f0)
    }

    /// Largest |d z'/d z| along a trajectory [1/s]: it is a0 |v|, loading and unloading alike.
    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        p.a0 * loading.peak_velocity
    }
}
