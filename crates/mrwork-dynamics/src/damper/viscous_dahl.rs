//! Viscous and Dahl model of Ikhouane and Dyke (2007).

use super::dahl::build_up;
use super::model::{DamperModel, DamperSpec, Motion, Severity, Short};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    k_x: "N s/m", Log, 1e-3 .. 1e9, nominal 2500.0, force_only, "viscous damping";
    k_w: "N", Log, 1e-3 .. 1e9, nominal 700.0, force_only, "yield force: the loop lies between +-k_w";
    rho: "1/m", Log, 1e-2 .. 1e7, nominal 3000.0, "initial slope: the loop yields within about 1/rho of travel";
    f0: "N", Offset, -1e8 .. 1e8, nominal 40.0, force_only, "force offset";
}

/// Dahl's friction in parallel with a dashpot.
#[derive(Clone, Copy)]
pub struct ViscousDahl;

impl DamperModel for ViscousDahl {
    const SHORT: Short = Short::Always;
    const SPEC: DamperSpec = DamperSpec {
        name: "viscous_dahl",
        title: "Viscous and Dahl",
        equation: "f = k_x v + k_w w + f0\n\
                   w' = rho (v - |v| w)",
        description: "Dahl's friction and a dashpot: the fewest parameters that give a hysteresis loop, and \
                      passive under any motion except for f0, which the published model lacks. There is no \
                      stiffness in parallel, hence no accumulator, and the knee has one shape, an exponential. \
                      k_x multiplies the velocity: it is a damping. It is normalised_bouc_wen with n = 1, sigma \
                      = 1, k = 0.",
        source: "Ikhouane, Dyke, Smart Mater. Struct. 16(3), 2007, 605-616",
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
    fn force<R: Real>(p: &Parameters<R>, [w]: [R; 1], motion: Motion<R>) -> R {
        p.k_x.mul_add(motion.velocity, p.k_w.mul_add(w, p.f0))
    }

    /// Largest |d w'/d w| along a trajectory [1/s]: it is rho |v|, loading and unloading alike.
    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        p.rho * loading.peak_velocity
    }
}
