//! Modified Bouc-Wen model whose dashpot thins with velocity.

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use super::normalised_bouc_wen::Hysteresis;
use super::normalised_modified_bouc_wen::{fastest_relaxation, series_rate};
use crate::elementary::exp;
use crate::parameters::parameters;
use crate::real::Real;

/// `z_max` of the Dyke 1996 set: (301 / 7.26e6)^(1/2) m.
const Z_MAX: f64 = 6.438_948_291_174_479e-3;

parameters! {
    c0: "N s/m", Log, 1e-3 .. 1e9, nominal 2887.5, "viscous damping beside the loop, at large velocities";
    c2: "N s/m", Log, 1e-3 .. 1e9, nominal 2000.0, "viscous damping that vanishes as the velocity grows";
    v_s: "m/s", Log, 1e-6 .. 1e2, nominal 0.05, "velocity over which it vanishes";
    k0: "N/m", Log, 1e-3 .. 1e9, nominal 4690.0, "stiffness beside the loop, at large velocities";
    c1: "N s/m", Log, 1e-3 .. 1e9, nominal 28_963.75, "dashpot in series: reduces the force at small velocities";
    k1: "N/m", Linear, -1e9 .. 1e9, nominal 500.0, force_only, "stiffness in parallel, of the accumulator";
    x0: "m", Offset, -10.0 .. 10.0, nominal 0.143, force_only, "displacement at which the spring k1 is free";
    k_w: "N", Log, 1e-3 .. 1e9, nominal 170_375.0 * Z_MAX, "yield force of the loop";
    rho: "1/m", Log, 1e-2 .. 1e7, nominal 301.0 / Z_MAX, "initial slope: the loop yields within about 1/rho of x - y";
    sigma: "1", Log, 0.1 .. 1e4, nominal 0.5, "unloading: the slope just after a reversal is 2 sigma rho";
    n: "1", Linear, 1.0 .. 6.0, nominal 2.0, "sharpness of the knee";
    => hysteresis of rho, sigma, n: Hysteresis<R> = Hysteresis::of([rho, sigma, n]);
    per_v_s of v_s: R = R::splat(1.0) / v_s;
}

/// The normalised modified Bouc-Wen model with a dashpot c0 + c2 exp(-|v|/v_s).
#[derive(Clone, Copy)]
pub struct ShearThinningModifiedBoucWen;

impl DamperModel for ShearThinningModifiedBoucWen {
    const SPEC: DamperSpec = DamperSpec {
        name: "shear_thinning_modified_bouc_wen",
        title: "Shear-thinning modified Bouc-Wen",
        equation: "f = c1 y' + k1 (x - x0)\n\
                   y' = (k_w w + c v + k0 (x - y)) / (c + c1), c = c0 + c2 exp(-|v|/v_s)\n\
                   w' = rho (g - sigma |g| |w|^(n-1) w + (sigma - 1) g |w|^n), g = v - y'",
        description: "normalised_modified_bouc_wen for a fluid that thins under shear. The dashpot depends on \
                      the velocity of the whole damper, not on v - y', so that y' remains explicit. Its two \
                      further parameters are useful where one set has to fit slow and fast tests; on a single \
                      slow test the data do not distinguish c2 from c0. The limitations of \
                      normalised_modified_bouc_wen apply.",
        source: "Spencer, Dyke, Sain, Carlson, J. Eng. Mech. 123(3), 1997, 230-238; the thinning term is our own",
        nominal_source: "as normalised_modified_bouc_wen; c2 and v_s are our own choice (not verified)",
        parameters: PARAMETERS,
        n_states: 2,
        odd: true,
        offset_adds: true,
        relaxes: true,
        spring: Some(("k1", "x0")),
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 2];

    #[inline(always)]
    fn rate<R: Real>(p: &Parameters<R>, state: [R; 2], motion: Motion<R>) -> [R; 2] {
        let y_rate = velocity_of_c1(p, state, motion);
        [y_rate, p.hysteresis.rate(state[1], motion.velocity - y_rate)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, state: [R; 2], motion: Motion<R>) -> R {
        p.c1.mul_add(velocity_of_c1(p, state, motion), p.k1 * (motion.displacement - p.x0))
    }

    /// The thinned dashpot is the softest: with it alone all relaxations are fastest.
    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        fastest_relaxation([p.c0, p.k0, p.c1, p.k_w], [p.rho, p.sigma, p.n], loading)
    }
}

/// y', the velocity of the dashpot c1.
#[inline(always)]
fn velocity_of_c1<R: Real>(p: &Parameters<R>, state: [R; 2], motion: Motion<R>) -> R {
    let damping = p.c2.mul_add(exp(-(motion.velocity.abs() * p.per_v_s)), p.c0);
    series_rate([damping, p.k0, p.k_w], R::splat(1.0) / (damping + p.c1), state, motion)
}
