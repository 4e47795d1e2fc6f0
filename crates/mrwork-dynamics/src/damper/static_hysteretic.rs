//! Static hysteretic model of Kwok et al. (2006).

use super::model::{DamperModel, DamperSpec, Motion, Severity};
use crate::elementary::tanh;
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    c: "N s/m", Log, 1e-3 .. 1e9, nominal 3161.0, "viscous damping";
    k: "N/m", Linear, -1e9 .. 1e9, nominal 3400.0, "stiffness";
    alpha: "N", Log, 1e-3 .. 1e9, nominal 706.0, "height of the hysteresis";
    beta: "s/m", Log, 1e-3 .. 1e7, nominal 100.0, "steepness of the hysteresis over velocity";
    delta: "1", Linear, -10.0 .. 10.0, nominal 0.88, "half width of the hysteresis, in units of beta v";
    x_s: "m", Log, 1e-7 .. 1e2, nominal 1e-4, "displacement over which the hysteresis changes side";
    f0: "N", Offset, -1e8 .. 1e8, nominal 39.0, "force offset";
    => per_x_s of x_s: R = R::splat(1.0) / x_s;
}

/// Force as a function of displacement and velocity alone.
#[derive(Clone, Copy)]
pub struct StaticHysteretic;

impl DamperModel for StaticHysteretic {
    const SPEC: DamperSpec = DamperSpec {
        name: "static_hysteretic",
        title: "Static hysteretic",
        equation: "f = c v + k x + alpha tanh(beta v + delta tanh(x/x_s)) + f0",
        description: "No internal state: the force depends on the present motion and current only. The published \
                      model has sgn(x) in place of tanh(x/x_s): a plain sign chatters near rest in a closed \
                      loop. The two agree as x_s goes to zero; 0.1 mm is the default, and it is best identified.",
        source: "Kwok, Ha, Nguyen, Li, Samali, Sens. Actuators A 132, 2006, 441-451",
        nominal_source: "RD-1005-3 at 1 A, from the current polynomials of Kwok et al. 2006 \
                         (published, not independently verified)",
        parameters: PARAMETERS,
        n_states: 0,
        odd: true,
        offset_adds: true,
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
        Self::force_on_side(p, tanh(motion.displacement * p.per_x_s), motion)
    }

    #[inline(always)]
    fn stiffness_bound(_: &Parameters<f64>, _: Severity) -> f64 {
        0.0
    }
}

impl StaticHysteretic {
    /// The force for a given `side = tanh(x/x_s)`.
    #[inline(always)]
    pub(crate) fn force_on_side<R: Real>(p: &Parameters<R>, side: R, motion: Motion<R>) -> R {
        let Motion { displacement: x, velocity: v } = motion;
        let hysteresis = tanh(p.beta.mul_add(v, p.delta * side));
        p.c.mul_add(v, p.k.mul_add(x, p.alpha.mul_add(hysteresis, p.f0)))
    }
}
