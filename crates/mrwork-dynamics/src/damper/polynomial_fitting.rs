//! Polynomial-fitting model: a sigmoid mean and a Gaussian thickness over velocity.

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::elementary::{exp, tanh};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    a: "N", Log, 1e-3 .. 1e9, nominal 700.0, "yield force of the mean curve";
    b: "s/m", Log, 1e-3 .. 1e7, nominal 60.0, "steepness of the mean curve";
    v0: "m/s", Offset, -1e2 .. 1e2, nominal 5e-3, "velocity at the middle of the mean curve";
    c: "N s/m", Log, 1e-3 .. 1e9, nominal 2000.0, "viscous damping";
    f0: "N", Offset, -1e8 .. 1e8, nominal 40.0, "force offset";
    h: "N", Log, 1e-3 .. 1e9, nominal 500.0, "largest thickness of the loop, upper branch less lower branch";
    v1: "m/s", Offset, -1e2 .. 1e2, nominal -4e-3, "velocity at which the loop is thickest";
    w: "m/s", Log, 1e-7 .. 1e2, nominal 0.05, "half width of the loop over velocity";
    x_s: "m", Log, 1e-7 .. 1e2, nominal 5e-4, "displacement over which the branch changes";
    => per_w of w: R = R::splat(1.0) / w;
    per_x_s of x_s: R = R::splat(1.0) / x_s;
}

/// A mean curve over velocity and the distance of the two branches from it.
#[derive(Clone, Copy)]
pub struct PolynomialFitting;

impl DamperModel for PolynomialFitting {
    const SPEC: DamperSpec = DamperSpec {
        name: "polynomial_fitting",
        title: "Polynomial-fitting",
        equation: "f = F_m + tanh(x/x_s) T/2\n\
                   F_m = a (2/(1 + exp(-b (v - v0))) - 1) + c v + f0\n\
                   T = h exp(-(v - v1)^2/(2 w^2))",
        description: "A curve fit of one harmonic test: the mean of the two branches over velocity and their \
                      distance; each coefficient is then a polynomial in the current, hence the name. The \
                      published branch is -sgn(v'), upper while the damper slows down. Here it is tanh(x/x_s), \
                      which is the same in a harmonic test about x = 0 as x_s goes to zero, because a measured \
                      acceleration is the second derivative of noise. In any other motion the two differ, and \
                      neither is intended for it: for a test about another x, or a broad-band one, use another \
                      model. The identified x_s of a real damper is large, because the branches part gradually; \
                      once it exceeds the stroke, the data determine only h/x_s. Fix x_s at a small value for \
                      the published branch. There is no stiffness beyond the thickness, and coefficients of one \
                      frequency do not apply to another.",
        source: "after Nguyen, PhD thesis, University of Technology, Sydney, 2009, section 5.4; \
                 its text was not at hand, the curves are our definition",
        nominal_source: "our own, typical of a small damper of 1-3 kN; not verified against a record",
        parameters: PARAMETERS,
        n_states: 0,
        odd: true,
        offset_adds: false,
        relaxes: false,
        spring: None,
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 0];

    #[inline(always)]
    fn rate<R: Real>(_: &Parameters<R>, state: [R; 0], _: Motion<R>) -> [R; 0] {
        state
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, _: [R; 0], motion: Motion<R>) -> R {
        let Motion { displacement: x, velocity: v } = motion;
        let half = R::splat(0.5);
        // 2/(1 + exp(-y)) - 1 is tanh(y/2), which keeps its sign and its digits for small y.
        let sigmoid = tanh(half * p.b * (v - p.v0));
        let mean = p.a.mul_add(sigmoid, p.c.mul_add(v, p.f0));
        let deviation = (v - p.v1) * p.per_w;
        let thickness = p.h * exp(-half * deviation * deviation);
        (half * tanh(x * p.per_x_s)).mul_add(thickness, mean)
    }

    #[inline(always)]
    fn stiffness_bound(_: &Parameters<f64>, _: Severity) -> f64 {
        0.0
    }
}
