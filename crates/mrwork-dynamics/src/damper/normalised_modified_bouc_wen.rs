//! Modified Bouc-Wen model with the loop of Ikhouane and Rodellar.

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use super::normalised_bouc_wen::{self, Hysteresis};
use crate::parameters::parameters;
use crate::real::Real;

/// `z_max` of the Dyke 1996 set: (301 / 7.26e6)^(1/2) m.
const Z_MAX: f64 = 6.438_948_291_174_479e-3;

parameters! {
    c0: "N s/m", Log, 1e-3 .. 1e9, nominal 2887.5, "viscous damping beside the loop, at large velocities";
    k0: "N/m", Log, 1e-3 .. 1e9, nominal 4690.0, "stiffness beside the loop, at large velocities";
    c1: "N s/m", Log, 1e-3 .. 1e9, nominal 28_963.75, "dashpot in series: reduces the force at small velocities";
    k1: "N/m", Linear, -1e9 .. 1e9, nominal 500.0, force_only, "stiffness in parallel, of the accumulator";
    x0: "m", Offset, -10.0 .. 10.0, nominal 0.143, force_only, "displacement at which the spring k1 is free";
    k_w: "N", Log, 1e-3 .. 1e9, nominal 170_375.0 * Z_MAX, "yield force of the loop";
    rho: "1/m", Log, 1e-2 .. 1e7, nominal 301.0 / Z_MAX, "initial slope: the loop yields within about 1/rho of x - y";
    sigma: "1", Log, 0.1 .. 1e4, nominal 0.5, "unloading: the slope just after a reversal is 2 sigma rho";
    n: "1", Linear, 1.0 .. 6.0, nominal 2.0, "sharpness of the knee";
    => hysteresis of rho, sigma, n: Hysteresis<R> = Hysteresis::of([rho, sigma, n]);
    mobility of c0, c1: R = R::splat(1.0) / (c0 + c1);
}

/// The modified Bouc-Wen model without its redundant parameter.
#[derive(Clone, Copy)]
pub struct NormalisedModifiedBoucWen;

impl DamperModel for NormalisedModifiedBoucWen {
    const SPEC: DamperSpec = DamperSpec {
        name: "normalised_modified_bouc_wen",
        title: "Normalised modified Bouc-Wen",
        equation: "f = c1 y' + k1 (x - x0)\n\
                   y' = (k_w w + c0 v + k0 (x - y)) / (c0 + c1)\n\
                   w' = rho (g - sigma |g| |w|^(n-1) w + (sigma - 1) g |w|^n), g = v - y'",
        description: "The modified Bouc-Wen model with its loop scaled to |w| <= 1: the form to identify. rho = \
                      A/z_max, sigma = gamma/(beta+gamma), k_w = alpha z_max, the rest as in modified_bouc_wen. \
                      Without k1 the data do not determine x0; on records much shorter than (c0+c1)/k0 the data \
                      hardly distinguish k0 from k1.",
        source: "Spencer, Dyke, Sain, Carlson, J. Eng. Mech. 123(3), 1997, 230-238; loop of Ikhouane, Rodellar, \
                 Systems with Hysteresis, Wiley, 2007",
        nominal_source: "prototype damper of Dyke et al., Smart Mater. Struct. 5, 1996, 565-575, held at 2.25 V, \
                         converted (verified against their building responses)",
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
        let y_rate = series_rate([p.c0, p.k0, p.k_w], p.mobility, state, motion);
        [y_rate, p.hysteresis.rate(state[1], motion.velocity - y_rate)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, state: [R; 2], motion: Motion<R>) -> R {
        let y_rate = series_rate([p.c0, p.k0, p.k_w], p.mobility, state, motion);
        p.c1.mul_add(y_rate, p.k1 * (motion.displacement - p.x0))
    }

    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        fastest_relaxation([p.c0, p.k0, p.c1, p.k_w], [p.rho, p.sigma, p.n], loading)
    }
}

/// y', the velocity of the dashpot c1; `mobility` is 1/(c0 + c1).
#[inline(always)]
pub(super) fn series_rate<R: Real>(
    [c0, k0, k_w]: [R; 3],
    mobility: R,
    [y, w]: [R; 2],
    motion: Motion<R>,
) -> R {
    let elastic = k0.mul_add(motion.displacement - y, k_w * w);
    c0.mul_add(motion.velocity, elastic) * mobility
}

/// Weight of the relaxation rate of a saturated loop. There the step only has to be stable: w is within a few per cent of
/// +-1, and an error falls to less than a half with each sub-step. So step times relaxation rate may be 2.15 instead of 1.4.
const SATURATED: f64 = 0.65;

/// Largest relaxation of y and w along a trajectory [1/s].
///
/// The loop is driven at `g = (c1 v - k_w w - k0 (x - y))/(c0 + c1)`. While it loads, `k_w w` opposes c1 v, so |g| is at
/// most c1 |v|/(c0 + c1), and so is its acceleration; where it is saturated, less by `k_w/(c0 + c1)`. On its knee g is
/// the integral of that acceleration since the reversal, over a travel of 2/rho. Through g, w has a feedback on itself at
/// `rho k_w/(c0 + c1)` times the slope of the loop, at most 2 sigma or 1; y has one at k0/(c0 + c1). A record that starts
/// in motion crosses its first knee at full velocity and is inaccurate there for a few sub-steps.
pub(super) fn fastest_relaxation(
    [c0, k0, c1, k_w]: [f64; 4],
    [rho, sigma, n]: [f64; 3],
    loading: Severity,
) -> f64 {
    let damping = c0 + c1;
    let peak_velocity = c1 * loading.peak_velocity / damping;
    let reversal_acceleration = c1 * loading.reversal_acceleration / damping;
    let knee_velocity = peak_velocity.min((4.0 * reversal_acceleration / rho).sqrt());
    let knee = Severity { peak_velocity: knee_velocity, reversal_acceleration };
    let pull_back = rho * k_w / damping * (2.0 * sigma).max(1.0);
    let on_the_knee = normalised_bouc_wen::fastest_relaxation(rho, sigma, n, knee) + pull_back;
    let saturated = n * rho * (peak_velocity - k_w / damping);
    on_the_knee.max(SATURATED * saturated) + k0 / damping
}
