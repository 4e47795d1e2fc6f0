//! A damper recorded: what it does in a sub-step, as statements of C.

use super::print::{Precision, statements};
use super::{TAPE, Term};
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Motion, MotionNumber, State};
use crate::damper::{ModelVisitor, visit};
use crate::elementary::exp;
use crate::parameters::FromSlice;
use crate::real::Real;

type T = Term<false>;

impl MotionNumber<Self> for T {
    fn splat(self) -> Self {
        self
    }
    fn times(self, factor: f64) -> Self {
        self * <Self as Real>::splat(factor)
    }
    fn by_sign(self, positive: Self, negative: Self) -> Self {
        Real::by_sign(self, positive, negative)
    }
}

/// Statements of the functions of a damper, whose memory is `m`.
///
/// `m->prepared` are the coefficients as the laws take them, `m->p` the parameters at the current in the coil, `m->state` the
/// states and `m->decay` the factor by which the driver's lag shrinks in half a sub-step.
pub struct DamperText {
    /// Fills `m->prepared` and, with a lag, `m->decay` from the coefficients.
    pub prepare: String,
    /// Fills `p[]` from `m->prepared` and `current`.
    pub parameters: String,
    /// Returns the force at the motion `x`, `v`.
    pub force: String,
    /// Fills `rate[]` at the motion `x`, `v`.
    pub rate: String,
    /// Moves `m->state` by a sub-step with `motion[6]`, displacement and velocity at its start, middle and end; with a lag from
    /// the parameters `m->p`, `middle` and `end`.
    pub substep: String,
}

struct Recorded<'a> {
    coefficients: &'a [String],
    laws: &'a CurrentLaws,
    step: f64,
    precision: Precision,
}

/// `NAME[0]`, `NAME[1]`, ...
fn entries(name: &str, count: usize) -> impl Iterator<Item = String> + '_ {
    (0..count).map(move |entry| format!("{name}[{entry}]"))
}

/// Inputs of these expressions, and the statements that assign what a formula makes of them.
fn recorded<const N: usize>(
    inputs: [Vec<String>; N],
    precision: Precision,
    formula: impl FnOnce([Vec<T>; N]) -> Vec<(String, T)>,
) -> String {
    TAPE.take();
    let mut number = 0;
    let terms = inputs.each_ref().map(|group| {
        let first = number;
        number += group.len();
        (first..number).map(T::input).collect()
    });
    let ends: Vec<(String, usize)> = formula(terms).into_iter().map(|(left, term)| (left, term.0)).collect();
    statements(&inputs.concat(), &ends, precision)
}

fn assigned(name: &str, terms: impl IntoIterator<Item = T>) -> Vec<(String, T)> {
    terms.into_iter().enumerate().map(|(entry, term)| (format!("{name}[{entry}] ="), term)).collect()
}

fn terms_of<S: State<T>>(state: S) -> Vec<T> {
    let mut terms = Vec::new();
    state.for_each(|_, term| terms.push(term));
    terms
}

impl ModelVisitor<DamperText> for Recorded<'_> {
    fn visit<M: DamperModel + 'static>(self) -> DamperText {
        let Self { coefficients, laws, step, precision } = self;
        let (n_states, n_params) = (M::SPEC.n_states, laws.n_params());
        let state = || entries("m->state", n_states).collect::<Vec<_>>();
        let own = || entries("m->p", n_params).collect::<Vec<_>>();
        let motion = || vec!["x".to_owned(), "v".to_owned()];
        let at = |motion: &[T]| Motion { displacement: motion[0], velocity: motion[1] };
        let states = |terms: &[T]| M::State::<T>::from_fn(|entry| terms[entry]);
        let prepare = recorded([coefficients.to_vec()], precision, |[mut columns]| {
            laws.prepare(&mut columns);
            let decay =
                laws.lag_column().map(|column| exp(columns[column] * <T as Real>::splat(-0.5 * step)));
            let decay = decay.map(|decay| ("m->decay =".to_owned(), decay));
            assigned("m->prepared", columns).into_iter().chain(decay).collect()
        });
        let columns = entries("m->prepared", laws.n_columns()).collect();
        let parameters = recorded([columns, vec!["current".into()]], precision, |[columns, current]| {
            let mut values = vec![<T as Real>::splat(f64::NAN); n_params];
            laws.evaluate(&columns, current[0], &mut values);
            assigned("p", values)
        });
        let force = recorded([own(), state(), motion()], precision, |[p, state, motion]| {
            vec![("return".into(), M::force(&M::Parameters::from_slice(&p), states(&state), at(&motion)))]
        });
        let rate = recorded([own(), state(), motion()], precision, |[p, state, motion]| {
            assigned("rate", terms_of(M::rate(&M::Parameters::from_slice(&p), states(&state), at(&motion))))
        });
        let others = |name| entries(name, if laws.lag_column().is_some() { n_params } else { 0 }).collect();
        let inputs = [own(), others("middle"), others("end"), state(), entries("motion", 6).collect()];
        let mut substep = recorded(inputs, precision, |[own, middle, end, state, motion]| {
            let ways =
                [&own, &middle, &end].map(|p| M::Parameters::from_slice(if p.is_empty() { &own } else { p }));
            let motions = [0, 2, 4].map(|place| at(&motion[place..]));
            let next = M::step::<T, T, false>(ways.each_ref(), states(&state), motions, step);
            let next = terms_of(next).into_iter().enumerate();
            // Assigned after all is worked out.
            next.map(|(entry, term)| (format!("const {} next_{entry} =", precision.word()), term)).collect()
        });
        for entry in 0..n_states {
            substep.push_str(&format!("    m->state[{entry}] = next_{entry};\n"));
        }
        DamperText { prepare, parameters, force, rate, substep }
    }
}

/// The functions of the damper of that name with these laws; `coefficients` are the expressions of their values, and `step` is
/// the length of a sub-step [s]. `None` where no damper has that name.
#[must_use]
pub fn damper_text(
    name: &str,
    coefficients: &[String],
    laws: &CurrentLaws,
    step: f64,
    precision: Precision,
) -> Option<DamperText> {
    visit(name, Recorded { coefficients, laws, step, precision })
}
