//! Maxwell element: a spring in series with a dashpot, or a spring that a valve lets go.

use super::model::{DamperModel, DamperSpec, Motion, Severity, Short};
use crate::parameters::parameters;
use crate::real::Real;

parameters! {
    k: "N/m", Log, 1e-3 .. 1e12, nominal 1e7, force_only, "stiffness of the spring in series";
    tau: "s", Log, 1e-4 .. 1e3, nominal 5e-4, "relaxation time: the dashpot in series is k tau";
    c: "N s/m", Log, 1e-3 .. 1e9, nominal 500.0, force_only, "viscous damping in parallel";
    f0: "N", Offset, -1e8 .. 1e8, nominal 20.0, force_only, "force offset";
    => release of tau: R = R::splat(1.0) / tau;
}

/// A spring whose force relaxes; the state is its elongation [m].
#[derive(Clone, Copy)]
pub struct Maxwell;

impl DamperModel for Maxwell {
    const SHORT: Short = Short::Always;
    const SPEC: DamperSpec = DamperSpec {
        name: "maxwell",
        title: "Maxwell",
        equation: "f = k z + c v + f0\n\
                   z' = v - z/tau",
        description: "The linear viscoelastic damper: a spring in series with a dashpot. With a law of the valve \
                      on tau it is the resettable device of variable stiffness: closed, tau is long and it is a \
                      spring; opened for an instant, the energy of the spring is lost in the valve. No yield force: \
                      it is not a model of a magnetorheological fluid.",
        source: "Maxwell's element; as a resettable device: Bobrow, Jabbari, Thai, Smart Mater. Struct. 4, 1995, \
                 1-10, who let the force drop at once, which is the limit of a short tau",
        nominal_source: "our own choice: 5 kN s/m behind the compressibility of its liquid (not verified)",
        parameters: PARAMETERS,
        n_states: 1,
        odd: true,
        offset_adds: true,
        relaxes: true,
        spring: None,
    };
    type Parameters<R: Real> = Parameters<R>;
    type State<R: Real> = [R; 1];

    #[inline(always)]
    fn rate<R: Real>(p: &Parameters<R>, [z]: [R; 1], motion: Motion<R>) -> [R; 1] {
        [(-p.release).mul_add(z, motion.velocity)]
    }

    #[inline(always)]
    fn force<R: Real>(p: &Parameters<R>, [z]: [R; 1], motion: Motion<R>) -> R {
        p.k.mul_add(z, p.c.mul_add(motion.velocity, p.f0))
    }

    #[inline(always)]
    fn stiffness_bound(p: &Parameters<f64>, _: Severity) -> f64 {
        p.release
    }
}
