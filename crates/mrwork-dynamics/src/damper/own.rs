//! Dampers of users: formulas on tapes, with states of any number up to [`MOST_STATES`].
//!
//! A damper is registered under a name that holds the digest of all that it is, and stays for the life of the process.

use std::cell::{RefCell, RefMut};
use std::sync::RwLock;

use super::model::{DamperModel, DamperSpec, ModelVisitor, Motion, Severity};
use crate::any_damper::Damper;
use crate::error::DynamicsError;
use crate::parameters::{FromSlice, ParamSpec, Scale};
use crate::real::Real;
use crate::tape::{Tape, Walk};

/// Most states of a damper of a user.
pub const MOST_STATES: usize = 8;

/// A parameter of a damper of a user.
#[derive(Clone, Debug)]
pub struct Parameter {
    /// Name, as in the equations.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Scale in searches.
    pub scale: Scale,
    /// Smallest and largest admissible value, and a typical one.
    pub values: [f64; 3],
}

/// Formulas of a damper: their inputs are parameters, states, displacement and velocity, in this order.
#[derive(Clone, Debug)]
pub struct Formulas {
    /// Parameters in order.
    pub parameters: Vec<Parameter>,
    /// Number of states.
    pub n_states: usize,
    /// Force [N].
    pub force: Tape,
    /// Time derivatives of the states.
    pub rate: Tape,
    /// How fast the states relax [1/s]; nothing without states.
    pub relaxation: Tape,
}

impl Formulas {
    /// Refuses tapes that cannot be walked or have other inputs or results.
    fn check(&self, name: &str) -> Result<(), DynamicsError> {
        let n_inputs = self.parameters.len() + self.n_states + 2;
        let fits =
            |tape: &Tape, n_ends| tape.n_inputs == n_inputs && tape.ends.len() == n_ends && tape.is_sound();
        let sound = fits(&self.force, 1)
            && fits(&self.rate, self.n_states)
            && fits(&self.relaxation, usize::from(self.n_states > 0));
        if sound && self.n_states <= MOST_STATES {
            Ok(())
        } else {
            Err(DynamicsError::OwnDamper(name.to_owned()))
        }
    }
}

/// What a walk needs of a damper of a user, beside its lanes.
#[derive(Debug)]
pub struct Registered {
    formulas: Formulas,
    spec: DamperSpec,
    relaxes_by_motion: bool,
}

struct Named {
    own: &'static Registered,
    damper: &'static dyn Damper,
}

static DAMPERS: RwLock<Vec<Named>> = RwLock::new(Vec::new());

/// Registers a damper under a name that nothing else has; formulas that are known by that name stay as they are.
///
/// # Errors
/// If a tape is unsound, or has other inputs or results than the damper.
pub fn register(name: &str, formulas: Formulas) -> Result<(), DynamicsError> {
    formulas.check(name)?;
    let refused = |_| DynamicsError::OwnDamper(name.to_owned());
    if DAMPERS.read().map_err(refused)?.iter().any(|known| known.own.spec.name == name) {
        return Ok(());
    }
    let (own, damper) = made(name, formulas);
    DAMPERS.write().map_err(|_| DynamicsError::OwnDamper(name.to_owned()))?.push(Named { own, damper });
    Ok(())
}

/// Names and formulas live as long as the process: a few kB for each damper.
fn made(name: &str, formulas: Formulas) -> (&'static Registered, &'static dyn Damper) {
    let text = |text: &str| -> &'static str { Box::leak(text.to_owned().into_boxed_str()) };
    let parameters: Vec<ParamSpec> = (formulas.parameters.iter().enumerate())
        .map(|(place, Parameter { name, unit, scale, values: [lower, upper, nominal] })| ParamSpec {
            name: text(name),
            unit: text(unit),
            scale: *scale,
            lower: *lower,
            upper: *upper,
            nominal: *nominal,
            description: "",
            force_only: !reads(&formulas.rate, place),
        })
        .collect();
    let n_states = formulas.n_states;
    let spec = DamperSpec { name: text(name), parameters: Box::leak(parameters.into_boxed_slice()), ..PLAIN };
    let first = formulas.parameters.len();
    let relaxes_by_motion = (first..first + n_states).all(|state| !reads(&formulas.relaxation, state));
    let with = |room| DamperSpec { n_states: room, ..spec };
    macro_rules! leaked {
        ($room:literal) => {{
            let own: &'static Registered =
                Box::leak(Box::new(Registered { formulas, spec: with($room), relaxes_by_motion }));
            (own, Box::leak(Box::new(Own::<$room>(own))) as &'static dyn Damper)
        }};
    }
    match n_states {
        0 => leaked!(0),
        1 => leaked!(1),
        2 => leaked!(2),
        3 | 4 => leaked!(4),
        _ => leaked!(8),
    }
}

/// Whether a tape reads an input.
fn reads(tape: &Tape, input: usize) -> bool {
    let is_input = |&slot: &u16| usize::from(slot) == input;
    tape.ends.iter().any(is_input) || tape.entries.iter().any(|entry| entry.slots().iter().any(is_input))
}

/// The damper of a user with that name.
pub(super) fn find(name: &str) -> Option<&'static dyn Damper> {
    DAMPERS.read().ok()?.iter().find(|known| known.own.spec.name == name).map(|known| known.damper)
}

/// Does the work of a visitor for the damper of a user with that name.
pub(super) fn visit<T>(name: &str, visitor: impl ModelVisitor<T>) -> Option<T> {
    let own = DAMPERS.read().ok()?.iter().find(|known| known.own.spec.name == name).map(|known| known.own)?;
    Some(match own.spec.n_states {
        0 => visitor.visit(Own::<0>(own)),
        1 => visitor.visit(Own::<1>(own)),
        2 => visitor.visit(Own::<2>(own)),
        4 => visitor.visit(Own::<4>(own)),
        _ => visitor.visit(Own::<8>(own)),
    })
}

const PLAIN: DamperSpec = DamperSpec {
    name: "own",
    title: "",
    equation: "",
    description: "",
    source: "",
    nominal_source: "",
    parameters: &[],
    n_states: 0,
    odd: false,
    offset_adds: false,
    relaxes: false,
    spring: None,
};

/// A damper of a user with room for N states; those beyond its own stay at zero.
#[derive(Clone, Copy, Debug)]
pub struct Own<const N: usize>(&'static Registered);

/// The slots of the formulas of a damper, with its parameters in the first ones.
pub struct Slots<R> {
    of: Option<&'static Registered>,
    force: RefCell<Vec<R>>,
    rate: RefCell<Vec<R>>,
    relaxation: RefCell<Vec<R>>,
}

impl<R: Real> Slots<R> {
    fn of(own: &'static Registered, values: &[R]) -> Self {
        let Formulas { force, rate, relaxation, .. } = &own.formulas;
        let mut made = Self {
            of: Some(own),
            force: RefCell::new(force.slots()),
            rate: RefCell::new(rate.slots()),
            relaxation: RefCell::new(relaxation.slots()),
        };
        for slots in made.each() {
            for (slot, &value) in slots.iter_mut().zip(values) {
                *slot = value;
            }
        }
        made
    }

    fn each(&mut self) -> [&mut Vec<R>; 3] {
        [self.force.get_mut(), self.rate.get_mut(), self.relaxation.get_mut()]
    }

    /// The slots of a tape that was walked at a point.
    #[inline(always)]
    fn walked<'a, const N: usize>(
        own: &Registered,
        tape: &Tape,
        slots: &'a RefCell<Vec<R>>,
        state: [R; N],
        motion: Motion<R>,
    ) -> RefMut<'a, Vec<R>> {
        let mut slots = slots.borrow_mut();
        let Formulas { parameters, n_states, .. } = &own.formulas;
        let (first, count) = (parameters.len(), *n_states);
        let mut number = 0;
        while number < count {
            slots[first + number] = state[number];
            number += 1;
        }
        slots[first + count] = motion.displacement;
        slots[first + count + 1] = motion.velocity;
        R::out_of_line(Walk { tape, slots: &mut slots });
        slots
    }
}

impl<R: Real> Clone for Slots<R> {
    fn clone(&self) -> Self {
        let Self { of, force, rate, relaxation } = self;
        Self { of: *of, force: force.clone(), rate: rate.clone(), relaxation: relaxation.clone() }
    }

    /// Takes the parameters; what is beside them in the slots is of the last walk.
    #[inline(always)]
    fn clone_from(&mut self, from: &Self) {
        let n_params = from.of.map_or(0, |own| own.formulas.parameters.len());
        let theirs = [&from.force, &from.rate, &from.relaxation];
        for (slots, from) in self.each().into_iter().zip(theirs) {
            let from = from.borrow();
            let mut place = 0;
            while place < n_params {
                slots[place] = from[place];
                place += 1;
            }
        }
    }
}

impl<R: Real> FromSlice<R> for Slots<R> {
    /// Slots of no formula, which no model asks for.
    fn from_slice(_: &[R]) -> Self {
        let none = || RefCell::new(Vec::new());
        Self { of: None, force: none(), rate: none(), relaxation: none() }
    }

    #[inline(always)]
    fn follow(&mut self, values: &[R], follow: &[bool]) {
        for slots in self.each() {
            let mut place = 0;
            while place < follow.len() {
                if follow[place] {
                    slots[place] = values[place];
                }
                place += 1;
            }
        }
    }
}

impl<const N: usize> DamperModel for Own<N> {
    const SPEC: DamperSpec = DamperSpec { n_states: N, ..PLAIN };
    const WATCHED: bool = N > 0;
    type Parameters<R: Real> = Slots<R>;
    type State<R: Real> = [R; N];

    fn description(self) -> &'static DamperSpec {
        &self.0.spec
    }

    fn n_states(self) -> usize {
        self.0.formulas.n_states
    }

    #[inline(always)]
    fn parameters<R: Real>(self, values: &[R]) -> Slots<R> {
        Slots::of(self.0, values)
    }

    #[inline(always)]
    fn rate<R: Real>(p: &Slots<R>, state: [R; N], motion: Motion<R>) -> [R; N] {
        let mut rate = [R::splat(0.0); N];
        if let Some(own) = p.of {
            let tape = &own.formulas.rate;
            let slots = Slots::walked(own, tape, &p.rate, state, motion);
            let mut number = 0;
            while number < tape.ends.len() {
                rate[number] = slots[usize::from(tape.ends[number])];
                number += 1;
            }
        }
        rate
    }

    #[inline(always)]
    fn force<R: Real>(p: &Slots<R>, state: [R; N], motion: Motion<R>) -> R {
        let Some(own) = p.of else {
            return R::splat(f64::NAN);
        };
        let tape = &own.formulas.force;
        Slots::walked(own, tape, &p.force, state, motion)[usize::from(tape.ends[0])]
    }

    /// Not known before the motion, see [`DamperModel::WATCHED`].
    fn stiffness_bound(_: &Slots<f64>, _: Severity) -> f64 {
        0.0
    }

    #[inline(always)]
    fn relaxation<R: Real>(p: &Slots<R>, state: [R; N], motion: Motion<R>) -> R {
        let Some(own) = p.of else {
            return R::splat(f64::NAN);
        };
        let tape = &own.formulas.relaxation;
        Slots::walked(own, tape, &p.relaxation, state, motion)[usize::from(tape.ends[0])]
    }

    fn relaxes_by_motion(self) -> bool {
        self.0.relaxes_by_motion
    }
}
