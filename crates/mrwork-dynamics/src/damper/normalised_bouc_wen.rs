//! Normalised Bouc-Wen model of Ikhouane and Rodellar.

use super::model::{DamperModel, DamperSpec, Motion, MotionNumber, Severity, Short};
use crate::elementary::{Exponent, powf};
use crate::parameters::parameters;
use crate::real::Real;

/// `z_max` of the Spencer 1997 set: (120 / 2e6)^(1/2) m.
const Z_MAX: f64 = 7.745_966_692_414_834e-3;

parameters! {
    c: "N s/m", Log, 1e-3 .. 1e9, nominal 5000.0, force_only, "viscous damping";
    k: "N/m", Linear, -1e9 .. 1e9, nominal 2500.0, force_only, "stiffness in parallel, of the accumulator";
    x0: "m", Offset, -10.0 .. 10.0, nominal 0.038, force_only, "displacement at which the spring k is free";
    k_w: "N", Log, 1e-3 .. 1e9, nominal 88e3 * Z_MAX, force_only, "yield force: the loop lies between +-k_w";
    rho: "1/m", Log, 1e-2 .. 1e7, nominal 120.0 / Z_MAX, "initial slope: the loop yields within about 1/rho of travel";
    sigma: "1", Log, 0.1 .. 1e4, nominal 0.5, "unloading: the slope just after a reversal is 2 sigma rho";
    n: "1", Linear, 1.0 .. 6.0, nominal 2.0, "sharpness of the knee";
    => hysteresis of rho, sigma, n: Hysteresis<R> = Hysteresis::of([rho, sigma, n]);
}

/// The Bouc-Wen element without its redundant parameter.
#[derive(Clone, Copy)]
pub struct NormalisedBoucWen;

impl DamperModel for NormalisedBoucWen {
    const SHORT: Short = Short::WhereTwo(6);
    const SPEC: DamperSpec = DamperSpec {
        name: "normalised_bouc_wen",
        title: "Normalised Bouc-Wen",
        equation: "f = c v + k (x - x0) + k_w w\n\
                   w' = rho (v - sigma |v| |w|^(n-1) w + (sigma - 1) v |w|^n)",
        description: "The Bouc-Wen loop scaled to |w| <= 1, so that the data determine every parameter. rho = \
                      A/z_max, sigma = gamma/(beta+gamma), k_w = alpha z_max. The default for identification. \
                      For sigma >= 1/2, as in published sets, the element is passive under any motion; below \
                      that only its closed loops dissipate.",
        source: "Ikhouane, Rodellar, Systems with Hysteresis, Wiley, 2007",
        nominal_source: "Spencer et al. 1997, at 1.5 V, converted (published, not independently verified)",
        parameters: PARAMETERS,
        n_states: 1,
        odd: true,
        offset_adds: true,
        relaxes: false,
        spring: Some(("k", "x0")),
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 1];

    #[inline(always)]
    fn rate<R: Real>(p: &Parameters<R>, [w]: [R; 1], motion: Motion<R>) -> [R; 1] {
        [p.hysteresis.rate(w, motion.velocity)]
    }

    #[inline(always)]
    fn step<R: Real, V: MotionNumber<R>, const SHORT: bool>(
        [start, middle, end]: [&Parameters<R>; 3],
        [w]: [R; 1],
        [x_start, x_middle, x_end]: [Motion<V>; 3],
        step: V,
    ) -> [R; 1] {
        let loops = [&start.hysteresis, &middle.hysteresis, &end.hysteresis];
        [Hysteresis::step::<V, SHORT>(loops, w, [x_start.velocity, x_middle.velocity, x_end.velocity], step)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, [w]: [R; 1], motion: Motion<R>) -> R {
        let elastic = p.k.mul_add(motion.displacement - p.x0, p.k_w * w);
        p.c.mul_add(motion.velocity, elastic)
    }

    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        fastest_relaxation(p.rho, p.sigma, p.n, loading)
    }
}

/// The loop w' = slope v (1 - |w|^n (reversible + dissipative sgn(w v))), with what every step needs computed once.
#[derive(Clone, Copy)]
pub struct Hysteresis<R: Real> {
    slope: R,
    reversible: R,
    dissipative: R,
    /// reversible + dissipative sgn(w v) while the loop loads, and while it unloads.
    rounding: [R; 2],
    exponent: Exponent<R>,
}

impl<R: Real> Hysteresis<R> {
    /// The loop of the normalised model: w' = rho (v - sigma |v| |w|^(n-1) w + (sigma - 1) v |w|^n).
    #[inline(always)]
    pub(crate) fn of([rho, sigma, n]: [R; 3]) -> Self {
        Self::with([rho, R::splat(1.0) - sigma, sigma, n])
    }

    /// The loop [slope, reversible, dissipative, n].
    #[inline(always)]
    pub(crate) fn with([slope, reversible, dissipative, n]: [R; 4]) -> Self {
        let rounding = [reversible + dissipative, reversible - dissipative];
        Self { slope, reversible, dissipative, rounding, exponent: Exponent::of(n) }
    }

    /// w' at the velocity v: |v| |w|^(n-1) w is |v| sgn(w) |w|^n, so that one power serves both terms.
    #[inline(always)]
    pub(crate) fn rate(&self, w: R, v: R) -> R {
        let power = powf(w.abs(), &self.exponent);
        let rounding = self.reversible.mul_add(v, self.dissipative * v.copysign(w));
        self.slope * (-power).mul_add(rounding, v)
    }

    /// w after a step of classical Runge-Kutta; loops and velocities [m/s] are those at its start, middle and end, and every
    /// exponent is 2 where the step is `SHORT`.
    #[inline(always)]
    pub(crate) fn step<V: MotionNumber<R>, const SHORT: bool>(
        [start, middle, end]: [&Self; 3],
        w: R,
        [v_start, v_middle, v_end]: [V; 3],
        step: V,
    ) -> R {
        // Rates are worked out over half a step: the reach of the first two stages.
        let half = V::of(0.5) * step;
        let first = start.slope * (v_start * half).splat();
        let second = middle.slope * (v_middle * half).splat();
        let last = end.slope * (v_end * half).splat();
        let whole = second + second;
        let mut sum = w;
        if SHORT || (start.exponent.is_two() && middle.exponent.is_two() && end.exponent.is_two()) {
            sum = first * start.share(v_start, w, w * w);
            let at = w + sum;
            let s_2 = middle.share(v_middle, at, at * at);
            let at = second.mul_add(s_2, w);
            let s_3 = middle.share(v_middle, at, at * at);
            let at = whole.mul_add(s_3, w);
            sum = last.mul_add(end.share(v_end, at, at * at), whole.mul_add(s_2 + s_3, sum));
        } else {
            // A loop: a power is much code.
            let (mut at, mut s_2) = (w, w);
            for stage in 0..4 {
                let (own, v) = match stage {
                    0 => (start, v_start),
                    3 => (end, v_end),
                    _ => (middle, v_middle),
                };
                let share = own.share(v, at, powf(at.abs(), &own.exponent));
                match stage {
                    0 => {
                        sum = first * share;
                        at = w + sum;
                    }
                    1 => {
                        s_2 = share;
                        at = second.mul_add(share, w);
                    }
                    2 => {
                        sum = whole.mul_add(s_2 + share, sum);
                        at = whole.mul_add(share, w);
                    }
                    _ => sum = last.mul_add(share, sum),
                }
            }
        }
        R::splat(1.0 / 3.0).mul_add(sum, w)
    }

    /// 1 - |w|^n (reversible + dissipative sgn(w v)), the share of the initial slope.
    #[inline(always)]
    fn share<V: MotionNumber<R>>(&self, v: V, w: R, power: R) -> R {
        let [upwards, downwards] = v.exchanged(&self.rounding);
        (-power).mul_add(w.by_sign(upwards, downwards), R::splat(1.0))
    }
}

/// Largest |d w'/d w| along a trajectory [1/s].
///
/// While the loop loads it is at most n rho |v|. While it unloads it is n rho e |w|^(n-1) |v|, e = 2 sigma - 1,
/// which is large only just after a reversal, where v is small: with acceleration a the velocity after a travel s
/// is (2 a s)^(1/2), and w falls by dw/ds = -rho (1 + e |w|^n). Their product is largest where w^(n-1) = 1/2,
/// after s = 1/(4 (n-1) rho e) as far as it counts; for n near 1, at the end of unloading, s = ln(1+e)/(rho e).
pub(crate) fn fastest_relaxation(rho: f64, sigma: f64, n: f64, loading: Severity) -> f64 {
    let Severity { peak_velocity, reversal_acceleration } = loading;
    let excess = (2.0 * sigma - 1.0).abs();
    let travel = (1.0 + excess).ln().min(0.25 / (n - 1.0)) / (excess * rho);
    let unloading_velocity = peak_velocity.min((2.0 * reversal_acceleration * travel).sqrt());
    n * rho * peak_velocity.max(excess * unloading_velocity)
}
