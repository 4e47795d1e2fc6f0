//! A damper recorded: what it does in a sub-step, as statements of C.

use std::cell::Cell;

use super::formula::Formula;
use super::print::Precision;
use super::term::Term;
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Motion, MotionNumber, State};
use crate::damper::{ModelVisitor, visit};
use crate::lag::Decay;
use crate::real::Real;

type T = Term<false>;

impl MotionNumber<Self> for T {
    fn of(value: f64) -> Self {
        <Self as Real>::splat(value)
    }
    fn splat(self) -> Self {
        self
    }
    fn exchanged(self, &[first, second]: &[Self; 2]) -> [Self; 2] {
        [self.by_sign(first, second), self.by_sign(second, first)]
    }
}

/// Statements of the functions of a damper, whose memory is `m`.
///
/// `m->prepared` are the coefficients as the laws take them, `m->p` the parameters at the current in the coil, `m->state` the
/// states and `m->decay[][]` the factors by which the driver's lag shrinks in half a step, for each length a factor of each rate.
pub struct DamperText {
    /// Fills `m->prepared` and, with a lag, `m->decay[][]` from the coefficients.
    pub prepare: String,
    /// Fills `p[]` from `m->prepared` and `current`.
    pub parameters: String,
    /// Returns the force at the motion `x`, `v`.
    pub force: String,
    /// Fills `rate[]` at the motion `x`, `v`.
    pub rate: String,
    /// Moves `m->state` by a step of length `step` with `motion[6]`, displacement and velocity at its start, middle and end; with a lag from
    /// the parameters `m->p`, `middle` and `end`.
    pub substep: String,
    /// Length of `m->prepared`.
    pub n_prepared: usize,
    /// Whether they call elementary functions.
    pub calls: bool,
}

struct Recorded<'a> {
    coefficients: &'a [String],
    laws: &'a CurrentLaws,
    steps: &'a [f64],
    precision: Precision,
    calls: Cell<bool>,
}

fn assigned(name: &str, terms: impl IntoIterator<Item = T>) -> Vec<(String, T)> {
    terms.into_iter().enumerate().map(|(entry, term)| (format!("{name}[{entry}] ="), term)).collect()
}

fn terms_of<S: State<T>>(state: S) -> Vec<T> {
    let mut terms = Vec::new();
    state.for_each(|_, term| terms.push(term));
    terms
}

impl Recorded<'_> {
    fn statements(&self, formula: &Formula, ends: impl IntoIterator<Item = (String, T)>) -> String {
        self.calls.set(self.calls.get() | Formula::calls());
        formula.statements(ends)
    }

    fn prepare(&self) -> String {
        let mut formula = Formula::new(self.precision);
        let mut columns: Vec<T> = self.coefficients.iter().map(|name| formula.input(name)).collect();
        self.laws.prepare(&mut columns);
        let mut ends = Vec::new();
        if self.laws.are_lagged() {
            let rates = self.laws.rates(&columns);
            for (number, &step) in self.steps.iter().enumerate() {
                ends.extend(assigned(&format!("m->decay[{number}]"), Decay::of(rates, step).factors()));
            }
        }
        self.statements(&formula, assigned("m->prepared", columns).into_iter().chain(ends))
    }

    fn parameters(&self) -> String {
        let mut formula = Formula::new(self.precision);
        let columns = formula.inputs("m->prepared", self.laws.n_prepared());
        let current = formula.input("current");
        let mut values = vec![<T as Real>::splat(f64::NAN); self.laws.n_params()];
        self.laws.evaluate(&columns, current, &mut values);
        self.statements(&formula, assigned("p", values))
    }

    /// A formula of the parameters and states at a motion.
    fn at_point<M: DamperModel>(
        &self,
        model: M,
        ends: impl FnOnce(M::Parameters<T>, M::State<T>, Motion<T>) -> Vec<(String, T)>,
    ) -> String {
        let mut formula = Formula::new(self.precision);
        let p = model.parameters(&formula.inputs("m->p", self.laws.n_params()));
        let state = formula.inputs("m->state", model.n_states());
        let motion = Motion { displacement: formula.input("x"), velocity: formula.input("v") };
        let ends = ends(p, M::State::from_fn(|entry| entry_of(&state, entry)), motion);
        self.statements(&formula, ends)
    }

    fn substep<M: DamperModel>(&self, model: M) -> String {
        let mut formula = Formula::new(self.precision);
        let names: &[&str] = if self.laws.are_lagged() { &["m->p", "middle", "end"] } else { &["m->p"] };
        let values: Vec<Vec<T>> =
            names.iter().map(|name| formula.inputs(name, self.laws.n_params())).collect();
        let p = [0, 1, 2].map(|stage| model.parameters(values.get(stage).unwrap_or(&values[0])));
        let state = formula.inputs("m->state", model.n_states());
        let step = formula.input("step");
        let motion = formula.inputs("motion", 6);
        let motions =
            [0, 2, 4].map(|place| Motion { displacement: motion[place], velocity: motion[place + 1] });
        let count = state.len();
        let state = M::State::from_fn(|entry| entry_of(&state, entry));
        let mut next = terms_of(M::step::<T, T, false>(p.each_ref(), state, motions, step));
        next.truncate(count);
        let places: Vec<String> = (0..next.len()).map(|entry| format!("m->state[{entry}]")).collect();
        self.calls.set(self.calls.get() | Formula::calls());
        formula.assigned_at_once(&places, &next)
    }
}

/// A state; zero where the model has room for more than it has.
fn entry_of(states: &[T], entry: usize) -> T {
    states.get(entry).copied().unwrap_or_else(|| <T as Real>::splat(0.0))
}

/// The rates of the states that a model has.
fn rates<M: DamperModel>(model: M, rate: M::State<T>) -> Vec<(String, T)> {
    assigned("rate", terms_of(rate).into_iter().take(model.n_states()))
}

impl ModelVisitor<DamperText> for Recorded<'_> {
    fn visit<M: DamperModel + 'static>(self, model: M) -> DamperText {
        DamperText {
            prepare: self.prepare(),
            parameters: self.parameters(),
            force: self
                .at_point(model, |p, state, motion| vec![("return".to_owned(), M::force(&p, state, motion))]),
            rate: self.at_point(model, |p, state, motion| rates(model, M::rate(&p, state, motion))),
            substep: self.substep(model),
            n_prepared: self.laws.n_prepared(),
            calls: self.calls.get(),
        }
    }
}

/// The functions of the damper of that name with these laws; `coefficients` are the expressions of their values, and `steps` the
/// lengths of the steps that it takes [s]. `None` where no damper has that name.
#[must_use]
pub fn damper_text(
    name: &str,
    coefficients: &[String],
    laws: &CurrentLaws,
    steps: &[f64],
    precision: Precision,
) -> Option<DamperText> {
    visit(name, Recorded { coefficients, laws, steps, precision, calls: Cell::new(false) })
}
