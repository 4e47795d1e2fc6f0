//! Extended Bingham model of Gamota and Filisko.

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    f_c: "N", Log, 1e-3 .. 1e9, nominal 670.0, "yield force of the Bingham element";
    c0: "N s/m", Log, 1e-3 .. 1e9, nominal 5000.0, "viscous damping beyond yield";
    rho: "1/m", Log, 1e-2 .. 1e7, nominal 4500.0, "spring in series divided by f_c: yield within about 1/rho of travel";
    a: "1", Log, 1e-3 .. 1e3, nominal 1.0, "ratio of that spring to the one of the Kelvin-Voigt element, k2/k1";
    tau: "s", Log, 1e-6 .. 1e3, nominal 0.007, "retardation time of the Kelvin-Voigt element, c1/k1";
    f0: "N", Offset, -1e8 .. 1e8, nominal -95.0, force_only, "force offset";
    => per_c0 of c0: R = R::splat(1.0) / c0;
    per_tau of tau: R = R::splat(1.0) / tau;
}

/// A Bingham element, a Kelvin-Voigt element and a spring in series.
#[derive(Clone, Copy)]
pub struct ExtendedBingham;

impl DamperModel for ExtendedBingham {
    const SPEC: DamperSpec = DamperSpec {
        name: "extended_bingham",
        title: "Extended Bingham",
        equation: "f = q + f0, q = rho f_c (x - x_b - x_k)\n\
                   x_b' = sgn(q) max(|q| - f_c, 0) / c0\n\
                   x_k' = (a (x - x_b - x_k) - x_k) / tau",
        description: "A viscoelastic solid before yield, beyond it a Bingham fluid in series with that solid. \
                      x_b and x_k are the deflections of the Bingham and the Kelvin-Voigt element, so the flow \
                      law applies as written and no sign of a velocity is needed. In the published notation k2 = \
                      rho f_c, k1 = k2/a, c1 = tau k1. Stiff: k2/c0 and 1/tau are large in dampers and need many \
                      sub-steps. a and tau affect the force only before yield and just after a reversal.",
        source: "Gamota, Filisko, J. Rheology 35, 1991, 399-425",
        nominal_source: "f_c, c0 and f0 of the Bingham model of Spencer et al. 1997 at 1.5 V (published, not \
                         independently verified); rho, a and tau are our own choice (not verified)",
        parameters: PARAMETERS,
        n_states: 2,
        odd: true,
        offset_adds: true,
        relaxes: true,
        spring: None,
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 2];

    #[inline(always)]
    fn rate<R: Real>(p: &Parameters<R>, [x_b, x_k]: [R; 2], motion: Motion<R>) -> [R; 2] {
        let stretch = motion.displacement - x_b - x_k;
        let q = p.rho * p.f_c * stretch;
        let excess = q.abs() - p.f_c;
        let zero = R::splat(0.0);
        let flowing = R::select(zero.less(excess), excess.copysign(q), zero);
        [flowing * p.per_c0, p.a.mul_add(stretch, -x_k) * p.per_tau]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, [x_b, x_k]: [R; 2], motion: Motion<R>) -> R {
        (p.rho * p.f_c).mul_add(motion.displacement - x_b - x_k, p.f0)
    }

    /// The rates are linear before and after yield; no eigenvalue exceeds the sum of the diagonal.
    fn stiffness_bound(p: &Parameters<f64>, _: Severity) -> f64 {
        p.rho * p.f_c / p.c0 + (1.0 + p.a) / p.tau
    }
}
