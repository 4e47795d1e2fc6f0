//! The driver of the coil: model parameters over time, as functions of the command and the lag of the driver.

use core::mem::swap;

use crate::current_law::{CurrentLaws, Evaluate, Follow, Prepare};
use crate::damper::model::DamperModel;
use crate::lag::Decay;
use crate::parameters::FromSlice;
use crate::real::Real;

/// Provides the parameters of each step.
pub(crate) trait Driver<M: DamperModel, R: Real> {
    /// Whether every step is a short chain of arithmetic with these parameters.
    const SHORT: bool = false;
    /// Begins the interval of `sample`; its command is held until the next sample.
    fn begin(&mut self, sample: usize);
    /// Parameters at the current time.
    fn parameters(&self) -> &M::Parameters<R>;
    /// Advances by one step; returns the parameters at its start, middle and end.
    fn step(&mut self) -> [&M::Parameters<R>; 3];
}

/// Constant parameters: no law depends on the command, or the command is constant.
pub(crate) struct Steady<P, const SHORT: bool = false> {
    pub(crate) parameters: P,
}

impl<M: DamperModel, R: Real, const SHORT: bool> Driver<M, R> for Steady<M::Parameters<R>, SHORT> {
    const SHORT: bool = SHORT;

    #[inline(always)]
    fn begin(&mut self, _: usize) {}
    #[inline(always)]
    fn parameters(&self) -> &M::Parameters<R> {
        &self.parameters
    }
    #[inline(always)]
    fn step(&mut self) -> [&M::Parameters<R>; 3] {
        [&self.parameters; 3]
    }
}

/// Parameters that follow a command held between samples, behind the lag of the driver if there is one.
pub(crate) struct Following<'a, M: DamperModel, R: Real> {
    model: M,
    laws: &'a CurrentLaws,
    /// Prepared.
    columns: Vec<R>,
    values: Vec<R>,
    command: &'a [f64],
    held: R,
    /// Current in the coil: the command behind the lag.
    u: R,
    decay: Decay<R>,
    at: [M::Parameters<R>; 3],
}

impl<'a, M: DamperModel, R: Real> Following<'a, M, R> {
    /// Takes steps of another length [s] from now on.
    pub(crate) fn set_step(&mut self, step: f64) {
        self.decay = Decay::of(self.laws.rates(&self.columns), step);
    }

    /// The driver in steady state at the first command.
    #[inline(always)]
    pub(crate) fn new(
        model: M,
        laws: &'a CurrentLaws,
        mut columns: Vec<R>,
        command: &'a [f64],
        step: f64,
    ) -> Self {
        R::out_of_line(Prepare { laws, columns: &mut columns });
        let start = R::splat(command.first().copied().unwrap_or(f64::NAN));
        let decay = Decay::of(laws.rates(&columns), step);
        let mut values = vec![R::splat(f64::NAN); laws.n_params()];
        R::out_of_line(Evaluate { laws, prepared: &columns, current: start, values: &mut values });
        let parameters = model.parameters(&values);
        let at = [parameters.clone(), parameters.clone(), parameters];
        Self { model, laws, columns, values, command, held: start, u: start, decay, at }
    }

    /// Parameters at the current in the coil, from other prepared columns; derivatives with respect to its lag are dropped.
    #[inline(always)]
    pub(crate) fn parameters_of(&self, columns: &[R], values: &mut [R]) -> M::Parameters<R> {
        let current = self.u.without_derivatives();
        R::out_of_line(Evaluate { laws: self.laws, prepared: columns, current, values });
        self.model.parameters(values)
    }

    /// Moves the current by half a step and evaluates the parameters at this place of `at`.
    #[inline(always)]
    fn half_step(&mut self, place: usize) {
        self.u = self.decay.moved(self.u, self.held);
        self.evaluate(place);
    }

    #[inline(always)]
    fn evaluate(&mut self, place: usize) {
        let Self { laws, columns, u, values, .. } = self;
        R::out_of_line(Follow { laws, prepared: columns, current: u, values });
        self.at[place].follow(&self.values, self.laws.follows());
    }
}

impl<M: DamperModel, R: Real> Driver<M, R> for Following<'_, M, R> {
    #[inline(always)]
    fn begin(&mut self, sample: usize) {
        self.held = R::splat(self.command[sample]);
        if !self.laws.are_lagged() {
            self.u = self.held;
            self.evaluate(2);
        }
    }
    #[inline(always)]
    fn parameters(&self) -> &M::Parameters<R> {
        &self.at[2]
    }
    #[inline(always)]
    fn step(&mut self) -> [&M::Parameters<R>; 3] {
        let [start, _, end] = &mut self.at;
        swap(start, end);
        self.half_step(1);
        self.half_step(2);
        let [start, middle, end] = &self.at;
        [start, middle, end]
    }
}

/// Either driver, chosen for each block, so that code that is slow to compile is compiled once.
pub(crate) enum Either<'a, M: DamperModel, R: Real> {
    /// Constant parameters.
    Steady(Steady<M::Parameters<R>>),
    /// Parameters that follow the command.
    Following(Following<'a, M, R>),
}

impl<M: DamperModel, R: Real> Driver<M, R> for Either<'_, M, R> {
    #[inline(always)]
    fn begin(&mut self, sample: usize) {
        if let Self::Following(following) = self {
            following.begin(sample);
        }
    }
    #[inline(always)]
    fn parameters(&self) -> &M::Parameters<R> {
        match self {
            Self::Steady(steady) => &steady.parameters,
            Self::Following(following) => following.parameters(),
        }
    }
    #[inline(always)]
    fn step(&mut self) -> [&M::Parameters<R>; 3] {
        match self {
            Self::Steady(steady) => [&steady.parameters; 3],
            Self::Following(following) => following.step(),
        }
    }
}
