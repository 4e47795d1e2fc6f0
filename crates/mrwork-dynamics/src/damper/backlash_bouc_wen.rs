//! Normalised Bouc-Wen model behind a dead zone of the displacement.

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use super::normalised_bouc_wen::{Hysteresis, fastest_relaxation};
use crate::elementary::{exp, ln};
use crate::parameters::parameters;
use crate::real::Real;

/// `z_max` of the Spencer 1997 set: (120 / 2e6)^(1/2) m.
const Z_MAX: f64 = 7.745_966_692_414_834e-3;

/// Width s [m] over which the slope of the dead zone changes from 0 to 1.
///
/// A constant, not a share of g: as g goes to zero the dead zone vanishes evenly, and a step has to resolve s
/// however small g is. In proportion to g it would become a notch that any step falls into by chance.
const WIDTH: f64 = 2e-4;

parameters! {
    c: "N s/m", Log, 1e-3 .. 1e9, nominal 5000.0, force_only, "viscous damping";
    k: "N/m", Linear, -1e9 .. 1e9, nominal 2500.0, force_only, "stiffness in parallel, of the accumulator";
    x0: "m", Offset, -10.0 .. 10.0, nominal 0.038, force_only, "displacement d at which the spring k is free";
    k_w: "N", Log, 1e-3 .. 1e9, nominal 88e3 * Z_MAX, force_only, "yield force: the loop lies between +-k_w";
    rho: "1/m", Log, 1e-2 .. 1e7, nominal 120.0 / Z_MAX, "initial slope: the loop yields within about 1/rho of travel";
    sigma: "1", Log, 0.1 .. 1e4, nominal 0.5, "unloading: the slope just after a reversal is 2 sigma rho";
    n: "1", Linear, 1.0 .. 6.0, nominal 2.0, "sharpness of the knee";
    g: "m", Log, 1e-6 .. 1e-2, nominal 3e-4, "half width of the play: from x = -g to g the damper does not move";
    => hysteresis of rho, sigma, n: Hysteresis<R> = Hysteresis::of([rho, sigma, n]);
    play of g: R = exp(g * R::splat(-2.0 / WIDTH));
}

/// The normalised Bouc-Wen element, moved only outside the play of its joints.
#[derive(Clone, Copy)]
pub struct BacklashBoucWen;

impl DamperModel for BacklashBoucWen {
    const SPEC: DamperSpec = DamperSpec {
        name: "backlash_bouc_wen",
        title: "Bouc-Wen with backlash",
        equation: "f = c u + k (d - x0) + k_w w\n\
                   w' = rho (u - sigma |u| |w|^(n-1) w + (sigma - 1) u |w|^n)\n\
                   d = x - s/2 ln(cosh((x+g)/s) / cosh((x-g)/s)), s = 0.2 mm\n\
                   u = v (1 - (tanh((x+g)/s) - tanh((x-g)/s))/2), the rate of d",
        description: "normalised_bouc_wen for a damper whose joints have play: its motion d is x less a dead zone of \
                      half width g. A stroke within the play, from rest, meets no force; a longer one meets that of \
                      a stroke shorter by g. As g goes to zero the model is normalised_bouc_wen. The corners of \
                      the dead zone are rounded over s, so a play much smaller than s has no effect. Limitation: \
                      the play lies about x = 0 and not about the last reversal, and the loop keeps its force \
                      while the motion crosses it.",
        source: "normalised_bouc_wen; the dead zone as in Tao, Kokotovic, Adaptive Control of Systems with Actuator \
                 and Sensor Nonlinearities, Wiley, 1996, rounded by us",
        nominal_source: "as normalised_bouc_wen; g is our own choice (not verified)",
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
        [p.hysteresis.rate(w, DeadZone::at(p.play, motion.displacement).slope() * motion.velocity)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, [w]: [R; 1], motion: Motion<R>) -> R {
        let Motion { displacement: x, velocity: v } = motion;
        let dead_zone = DeadZone::at(p.play, x);
        let elastic = p.k.mul_add(dead_zone.displacement(x) - p.x0, p.k_w * w);
        p.c.mul_add(dead_zone.slope() * v, elastic)
    }

    /// Behind the dead zone the motion is nowhere faster; the dead zone itself is crossed at v/s, as far as it is deep.
    fn stiffness_bound(p: &Parameters<f64>, loading: Severity) -> f64 {
        let crossing = loading.peak_velocity / WIDTH * (p.g / WIDTH).tanh();
        let relaxation = fastest_relaxation(p.rho, p.sigma, p.n, loading);
        // A bound that is not a number is kept.
        if relaxation < crossing { crossing } else { relaxation }
    }
}

/// The dead zone at a displacement, by exponentials that do not overflow: r = exp(-2 g/s), q = exp(-2 |x|/s).
///
/// With them cosh((x+g)/s) / cosh((x-g)/s) is (1 + q r) / (q + r) for x >= 0, and its inverse below.
struct DeadZone<R> {
    q: R,
    r: R,
    above: R,
    below: R,
}

impl<R: Real> DeadZone<R> {
    #[inline(always)]
    fn at(r: R, x: R) -> Self {
        let q = exp(x.abs() * R::splat(-2.0 / WIDTH));
        Self { q, r, above: q.mul_add(r, R::splat(1.0)), below: q + r }
    }

    /// d, which is exactly zero at x = 0.
    #[inline(always)]
    fn displacement(&self, x: R) -> R {
        let size = ln(self.above / self.below).mul_add(R::splat(-0.5 * WIDTH), x.abs());
        size * R::splat(1.0).copysign(x)
    }

    /// dd/dx as a sum of positive terms: within the play it is far below 1, and a difference would lose it.
    #[inline(always)]
    fn slope(&self) -> R {
        let twice = self.r + self.r;
        let sum = self.q.mul_add(self.q + twice, R::splat(1.0));
        self.r * sum / (self.above * self.below)
    }
}
