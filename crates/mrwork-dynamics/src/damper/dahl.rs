//! Dahl's model of solid friction (1968).

use super::model::{DamperModel, DamperSpec, Motion, Severity, Short};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    k_w: "N", Log, 1e-3 .. 1e9, nominal 700.0, force_only, "yield force: the loop lies between +-k_w";
    rho: "1/m", Log, 1e-2 .. 1e7, nominal 3000.0, "initial slope: the loop yields within about 1/rho of travel";
    f0: "N", Offset, -1e8 .. 1e8, nominal 40.0, force_only, "force offset";
}

/// Friction that builds up over a travel.
#[derive(Clone, Copy)]
pub struct Dahl;

impl DamperModel for Dahl {
    const SHORT: Short = Short::Always;
    const SPEC: DamperSpec = DamperSpec {
        name: "dahl",
        title: "Dahl",
        equation: "f = k_w w + f0\n\
                   w' = rho (v - |v| w)",
        description: "Friction with a stiffness k_w rho before it slips, |w| <= 1, with exponent 1. The loop \
                      does not depend on the speed, so the model can represent tests at one low frequency only; \
                      for a damper with viscous force use viscous_dahl. It is normalised_bouc_wen with n = 1, \
                      sigma = 1, c = k = 0.",
        source: "Dahl, The Aerospace Corporation, TOR-0158(3107-18)-1, 1968",
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
    fn rate<R: Real>(p: &Parameters<R>, [w]: [R; 1], motion: Motion<R>) -> [R; 1] {
        [build_up(p.rho, w, motion.velocity)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, [w]: [R; 1], _: Motion<R>) -> R {
        p.k_w.mul_add(w, p.f0)
    }

    /// Largest |d w'/d w| along a trajectory [1/s]: it is rho |v|, loading and unloading alike.
    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        p.rho * loading.peak_velocity
    }
}

/// w' = rho (v - |v| w).
#[inline(always)]
pub(super) fn build_up<R: Real>(rho: R, w: R, v: R) -> R {
    rho * (-v.abs()).mul_add(w, v)
}
