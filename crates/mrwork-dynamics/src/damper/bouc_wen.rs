//! Bouc-Wen model in the form of Spencer et al. (1997).

use super::model::{DamperModel, DamperSpec, Motion, MotionNumber, Severity, Short};
use super::normalised_bouc_wen::{Hysteresis, fastest_relaxation};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    c0: "N s/m", Log, 1e-3 .. 1e9, nominal 5000.0, force_only, "viscous damping";
    k0: "N/m", Linear, -1e9 .. 1e9, nominal 2500.0, force_only, "stiffness in parallel, of the accumulator";
    x0: "m", Offset, -10.0 .. 10.0, nominal 0.038, force_only, "displacement at which the spring k0 is free";
    alpha: "N/m", Log, 1e-3 .. 1e12, nominal 88e3, force_only, "force per hysteretic displacement z";
    gamma: "m^-n", Log, 1e-3 .. 1e15, nominal 1e6, "rounds the loop and dissipates (multiplies |v| z |z|^(n-1))";
    beta: "m^-n", Linear, -1e15 .. 1e15, nominal 1e6, "rounds the loop reversibly (multiplies v |z|^n); above -gamma";
    A: "1", Log, 1e-3 .. 1e6, nominal 120.0, "initial slope of z over x";
    n: "1", Linear, 1.0 .. 6.0, nominal 2.0, "sharpness of the knee";
    => hysteresis of gamma, beta, A, n: Hysteresis<R> = Hysteresis::with([A, beta / A, gamma / A, n]);
}

/// The Bouc-Wen element in parallel with a spring and a dashpot.
#[derive(Clone, Copy)]
pub struct BoucWen;

impl DamperModel for BoucWen {
    const SHORT: Short = Short::WhereTwo(7);
    const SPEC: DamperSpec = DamperSpec {
        name: "bouc_wen",
        title: "Bouc-Wen (Spencer form)",
        equation: "f = c0 v + k0 (x - x0) + alpha z\n\
                   z' = -gamma |v| z |z|^(n-1) - beta v |z|^n + A v",
        description: "A smooth hysteresis loop between +-alpha z_max, z_max = (A/(beta+gamma))^(1/n). Redundant: \
                      alpha, A, beta and gamma contain one free scale, so data determine only three of them; use \
                      normalised_bouc_wen to identify. gamma and beta follow Spencer; OpenSees swaps the two.",
        source: "Spencer, Dyke, Sain, Carlson, J. Eng. Mech. 123(3), 1997, 230-238",
        nominal_source: "Spencer et al. 1997, at 1.5 V (published, not independently verified)",
        parameters: PARAMETERS,
        n_states: 1,
        odd: true,
        offset_adds: true,
        relaxes: false,
        spring: Some(("k0", "x0")),
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 1];

    #[inline(always)]
    fn rate<R: Real>(p: &Parameters<R>, [z]: [R; 1], motion: Motion<R>) -> [R; 1] {
        [p.hysteresis.rate(z, motion.velocity)]
    }

    #[inline(always)]
    fn step<R: Real, V: MotionNumber<R>, const SHORT: bool>(
        [start, middle, end]: [&Parameters<R>; 3],
        [z]: [R; 1],
        [x_start, x_middle, x_end]: [Motion<V>; 3],
        step: V,
    ) -> [R; 1] {
        let loops = [&start.hysteresis, &middle.hysteresis, &end.hysteresis];
        [Hysteresis::step::<V, SHORT>(loops, z, [x_start.velocity, x_middle.velocity, x_end.velocity], step)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, [z]: [R; 1], motion: Motion<R>) -> R {
        let elastic = p.k0.mul_add(motion.displacement - p.x0, p.alpha * z);
        p.c0.mul_add(motion.velocity, elastic)
    }

    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        match normalised([p.gamma, p.beta, p.A, p.n]) {
            Some(Normalised { rho, sigma, .. }) => fastest_relaxation(rho, sigma, p.n, loading),
            None => f64::INFINITY,
        }
    }
}

/// The loop [gamma, beta, A, n] on the scale of `w = z/z_max`.
pub(super) struct Normalised {
    pub z_max: f64,
    pub rho: f64,
    pub sigma: f64,
}

/// `None` if the state of the loop [gamma, beta, A, n] is unbounded, and with it the stiffness.
pub(super) fn normalised([gamma, beta, a, n]: [f64; 4]) -> Option<Normalised> {
    let sum = beta + gamma;
    let z_max = (a / sum).powf(1.0 / n);
    (sum > 0.0).then_some(Normalised { z_max, rho: a / z_max, sigma: gamma / sum })
}
