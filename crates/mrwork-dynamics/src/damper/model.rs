//! The trait of damper models and the types of its functions.

use core::ops::{Div, Mul};

use crate::parameters::{FromSlice, ParamSpec};
use crate::real::Real;

/// Description of a damper model: names, equations, sources, parameters.
#[derive(Clone, Copy, Debug)]
pub struct DamperSpec {
    /// Name in code and on the command line.
    pub name: &'static str,
    /// Name in prose.
    pub title: &'static str,
    /// Equations, in the letters of the parameters.
    pub equation: &'static str,
    /// Use and limitations of the model.
    pub description: &'static str,
    /// Source of the equations.
    pub source: &'static str,
    /// Source of the nominal values, and whether they were verified.
    pub nominal_source: &'static str,
    /// Parameters, in order.
    pub parameters: &'static [ParamSpec],
    /// Internal states.
    pub n_states: usize,
    /// Whether `f(-x, -v) = -f(x, v)` once the offset parameters are zero.
    pub odd: bool,
    /// Whether the offset parameters do no more than add a constant force.
    pub offset_adds: bool,
    /// Whether the states move while the damper is held still: a series dashpot creeps, a loop does not.
    pub relaxes: bool,
    /// Stiffness k and free length x0 of the accumulator's spring, whose force k (x - x0) depends on x0 through the
    /// product k x0 alone.
    pub spring: Option<(&'static str, &'static str)>,
}

/// When a step of a model is so short a chain of arithmetic that one vector after the other is faster than many side by side.
#[derive(Clone, Copy, Debug)]
pub enum Short {
    /// Its functions are long.
    Never,
    /// Its rate is a few products.
    Always,
    /// The exponent of its loop, the parameter at this place, is 2.
    WhereTwo(usize),
}

/// Elongation of the damper and its rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<R> {
    /// Displacement [m].
    pub displacement: R,
    /// Velocity [m/s].
    pub velocity: R,
}

/// The quantities of a loading on which the stiffness of a model depends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Severity {
    /// Largest speed [m/s].
    pub peak_velocity: f64,
    /// Largest acceleration with which the velocity changes sign [m/s^2].
    pub reversal_acceleration: f64,
}

impl<V> Motion<V> {
    /// The same motion in every lane.
    #[inline(always)]
    pub fn splat<R: Real>(self) -> Motion<R>
    where
        V: MotionNumber<R>,
    {
        Motion { displacement: self.displacement.splat(), velocity: self.velocity.splat() }
    }
}

/// A number of the motion of a step, or its length: a plain one, the same in every lane, or one that is recorded.
pub trait MotionNumber<R: Real>: Copy + Mul<Output = Self> + Div<Output = Self> {
    /// A number that is known.
    fn of(value: f64) -> Self;
    /// The same number in every lane.
    fn splat(self) -> R;
    /// A pair as it is where the sign bit is clear, exchanged where it is set.
    fn exchanged(self, pair: &[R; 2]) -> [R; 2];
}

impl<R: Real> MotionNumber<R> for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn splat(self) -> R {
        R::splat(self)
    }
    #[inline(always)]
    fn exchanged(self, pair: &[R; 2]) -> [R; 2] {
        // By place, not by a branch, which would copy lanes between registers.
        let negative = usize::from(self.is_sign_negative());
        [pair[negative], pair[1 - negative]]
    }
}

/// The internal states of a model: an array, one entry per state.
pub trait State<R: Real>: Copy {
    /// `self + step * rate`, for a step without derivatives.
    fn advance(self, step: R, rate: Self) -> Self;
    /// The values alone, see [`Real::without_derivatives`].
    fn without_derivatives(self) -> Self;
    /// The same number in every entry.
    fn splat(value: R) -> Self;
    /// States from and to plain numbers, entry by entry.
    fn from_fn(value: impl FnMut(usize) -> R) -> Self;
    /// Calls `receive(index, value)` for every entry.
    fn for_each(self, receive: impl FnMut(usize, R));
}

impl<R: Real, const N: usize> State<R> for [R; N] {
    #[inline(always)]
    fn advance(self, step: R, rate: Self) -> Self {
        let mut next = self;
        for i in 0..N {
            next[i] = rate[i].weighted(step, self[i]);
        }
        next
    }
    #[inline(always)]
    fn without_derivatives(self) -> Self {
        let mut values = self;
        for value in &mut values {
            *value = value.without_derivatives();
        }
        values
    }
    #[inline(always)]
    fn splat(value: R) -> Self {
        [value; N]
    }
    #[inline(always)]
    fn from_fn(mut value: impl FnMut(usize) -> R) -> Self {
        let mut entries = [R::splat(0.0); N];
        for (number, entry) in entries.iter_mut().enumerate() {
            *entry = value(number);
        }
        entries
    }
    #[inline(always)]
    fn for_each(self, mut receive: impl FnMut(usize, R)) {
        for (index, value) in self.into_iter().enumerate() {
            receive(index, value);
        }
    }
}

/// Work that is compiled for every damper model.
pub(crate) trait ModelVisitor<T> {
    /// Does the work for a model.
    fn visit<M: DamperModel + 'static>(self, model: M) -> T;
}

/// A damper model: its equations, written once over `R: Real`.
///
/// All functions must be `#[inline(always)]`: they run inside a loop compiled for each instruction set.
pub trait DamperModel: Copy + Sync {
    /// Name, prose, parameters.
    const SPEC: DamperSpec;
    /// When a step is a short chain of arithmetic.
    const SHORT: Short = Short::Never;
    /// Whether sub-steps follow from [`Self::relaxation`] along each motion, not from [`Self::stiffness_bound`].
    const WATCHED: bool = false;
    /// The struct that `parameters!` declares.
    type Parameters<R: Real>: FromSlice<R>;
    /// `[R; n]` for a model with n states.
    type State<R: Real>: State<R>;

    /// Name, prose, parameters of a model that is known at run time.
    fn description(self) -> &'static DamperSpec {
        const { &Self::SPEC }
    }

    /// Number of states, at most those that it has room for.
    fn n_states(self) -> usize {
        Self::SPEC.n_states
    }

    /// Parameters in spec order.
    #[inline(always)]
    fn parameters<R: Real>(self, values: &[R]) -> Self::Parameters<R> {
        Self::Parameters::from_slice(values)
    }

    /// Time derivative of the states.
    fn rate<R: Real>(p: &Self::Parameters<R>, state: Self::State<R>, motion: Motion<R>) -> Self::State<R>;

    /// The states after a step of classical Runge-Kutta [s]; parameters and motions are those at its start, middle and end.
    ///
    /// A model may write it out, where what depends on the motion alone is worked out once for both stages in the middle, and
    /// for parameters with which every step is `SHORT`.
    #[inline(always)]
    fn step<R: Real, V: MotionNumber<R>, const SHORT: bool>(
        [p_start, p_middle, p_end]: [&Self::Parameters<R>; 3],
        state: Self::State<R>,
        [start, middle, end]: [Motion<V>; 3],
        step: V,
    ) -> Self::State<R> {
        let (half, sixth, third) = (V::of(0.5) * step, step / V::of(6.0), step / V::of(3.0));
        // The stages are a loop, not four calls: written out, a pack of lanes outgrows the instruction cache.
        let stages = [
            (p_start, start, half, sixth),
            (p_middle, middle, half, third),
            (p_middle, middle, step, third),
            (p_end, end, V::of(0.0), sixth),
        ];
        let mut at = state;
        let mut next = state;
        for (p, motion, reach, weight) in stages {
            let rate = Self::rate(p, at, motion.splat());
            at = state.advance(reach.splat(), rate);
            next = next.advance(weight.splat(), rate);
        }
        next
    }

    /// Force with which the damper resists [N].
    fn force<R: Real>(p: &Self::Parameters<R>, state: Self::State<R>, motion: Motion<R>) -> R;

    /// Upper bound of the fastest relaxation of the states [1/s] under such a loading; 0 without states, not
    /// a finite number where the states have no bound.
    fn stiffness_bound(p: &Self::Parameters<f64>, loading: Severity) -> f64;

    /// How fast the states relax at a motion [1/s]; asked where the model is `WATCHED`.
    #[inline(always)]
    fn relaxation<R: Real>(_: &Self::Parameters<R>, _: Self::State<R>, _: Motion<R>) -> R {
        R::splat(0.0)
    }

    /// Whether [`Self::relaxation`] reads the motion alone, not the states.
    fn relaxes_by_motion(self) -> bool {
        false
    }
}
