//! Modified Bouc-Wen model of Spencer et al. (1997).

use super::bouc_wen::{Normalised, normalised};
use super::model::{DamperModel, DamperSpec, Motion, Severity};
use super::normalised_bouc_wen::Hysteresis;
use super::normalised_modified_bouc_wen::fastest_relaxation;
use crate::parameters::parameters;
use crate::real::Real;

/// Driver voltage of the nominal values [V].
const VOLTAGE: f64 = 2.25;

parameters! {
    c0: "N s/m", Log, 1e-3 .. 1e9, nominal 2100.0 + 350.0 * VOLTAGE, "viscous damping beside the loop, at large velocities";
    k0: "N/m", Log, 1e-3 .. 1e9, nominal 4690.0, "stiffness beside the loop, at large velocities";
    c1: "N s/m", Log, 1e-3 .. 1e9, nominal 28_300.0 + 295.0 * VOLTAGE, "dashpot in series: reduces the force at small velocities";
    k1: "N/m", Linear, -1e9 .. 1e9, nominal 500.0, force_only, "stiffness in parallel, of the accumulator";
    x0: "m", Offset, -10.0 .. 10.0, nominal 0.143, force_only, "displacement at which the spring k1 is free";
    alpha: "N/m", Log, 1e-3 .. 1e12, nominal 14_000.0 + 69_500.0 * VOLTAGE, "force per hysteretic displacement z";
    gamma: "m^-n", Log, 1e-3 .. 1e15, nominal 3.63e6, "rounds the loop and dissipates";
    beta: "m^-n", Linear, -1e15 .. 1e15, nominal 3.63e6, "rounds the loop reversibly; above -gamma";
    A: "1", Log, 1e-3 .. 1e6, nominal 301.0, "initial slope of z over x - y";
    n: "1", Linear, 1.0 .. 6.0, nominal 2.0, "sharpness of the knee";
    => hysteresis of gamma, beta, A, n: Hysteresis<R> = Hysteresis::with([A, beta / A, gamma / A, n]);
    mobility of c0, c1: R = R::splat(1.0) / (c0 + c1);
}

/// The Bouc-Wen element in series with a dashpot.
#[derive(Clone, Copy)]
pub struct ModifiedBoucWen;

impl DamperModel for ModifiedBoucWen {
    const SPEC: DamperSpec = DamperSpec {
        name: "modified_bouc_wen",
        title: "Modified Bouc-Wen (Spencer's phenomenological model)",
        equation: "f = c1 y' + k1 (x - x0)\n\
                   y' = (alpha z + c0 v + k0 (x - y)) / (c0 + c1)\n\
                   z' = -gamma |v - y'| z |z|^(n-1) - beta (v - y') |z|^n + A (v - y')",
        description: "Bouc-Wen in series with a dashpot c1, which reduces the force where the velocity is small \
                      and the acceleration opposes it. Redundant as bouc_wen is: alpha, A, beta and gamma \
                      contain one free scale; identify normalised_modified_bouc_wen. k1 x0 is a force offset, to \
                      be left out in simulations of buildings; without k1 the data do not determine x0. On \
                      records much shorter than (c0+c1)/k0 the data hardly distinguish k0 from k1. Stiff: the \
                      published damper yields within 21 um.",
        source: "Spencer, Dyke, Sain, Carlson, J. Eng. Mech. 123(3), 1997, 230-238",
        nominal_source: "prototype damper of Dyke et al., Smart Mater. Struct. 5, 1996, 565-575, held at 2.25 V \
                         (verified against their building responses)",
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
    fn rate<R: Real>(p: &Parameters<R>, [y, z]: [R; 2], motion: Motion<R>) -> [R; 2] {
        let y_rate = series_rate(p, [y, z], motion);
        [y_rate, p.hysteresis.rate(z, motion.velocity - y_rate)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, state: [R; 2], motion: Motion<R>) -> R {
        p.c1.mul_add(series_rate(p, state, motion), p.k1 * (motion.displacement - p.x0))
    }

    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        match normalised([p.gamma, p.beta, p.A, p.n]) {
            Some(Normalised { z_max, rho, sigma }) => {
                fastest_relaxation([p.c0, p.k0, p.c1, p.alpha * z_max], [rho, sigma, p.n], loading)
            }
            None => f64::INFINITY,
        }
    }
}

/// y', the velocity of the dashpot c1.
#[inline(always)]
fn series_rate<R: Real>(p: &Parameters<R>, [y, z]: [R; 2], motion: Motion<R>) -> R {
    let elastic = p.k0.mul_add(motion.displacement - y, p.alpha * z);
    p.c0.mul_add(motion.velocity, elastic) * p.mobility
}
