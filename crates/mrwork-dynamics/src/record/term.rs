//! A number that records its operations, and the list of them.

use core::ops::{Add, Div, Mul, Neg, Sub};
use std::cell::RefCell;
use std::collections::HashMap;

use crate::elementary::{Elementary, Exponent, exp, ln, powf, tanh};
use crate::lanes::Lanes;
use crate::real::{Bits, OutOfLine, Pairs, Real};

/// What an entry of the list is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(super) enum Kind {
    Constant,
    Input,
    Truth,
    Add,
    Sub,
    Mul,
    Div,
    Neg,
    Fma,
    Abs,
    Sqrt,
    CopySign,
    BySign,
    Min,
    Max,
    Round,
    Less,
    Equal,
    Select,
    Exp,
    Ln,
    Pow,
    Tanh,
    Exponent,
    Mantissa,
    Sixteenth,
    Entry,
    HalfTwo,
    TimesTwo,
    Cell,
    LookUp,
}

impl Kind {
    /// Whether it is a function of the crate, which is printed once beside the formulas.
    pub(super) fn is_call(self) -> bool {
        matches!(self, Self::Exp | Self::Ln | Self::Pow | Self::Tanh)
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Node {
    pub(super) kind: Kind,
    /// Places of the entries that it is made of; a table has its number in the second.
    pub(super) of: [usize; 3],
    /// Bits of a constant, number of an input, or a truth value.
    pub(super) bits: u64,
}

/// Entries in the order in which they were recorded; equal ones are one.
#[derive(Default)]
pub(super) struct Tape {
    pub(super) nodes: Vec<Node>,
    known: HashMap<Node, usize>,
    pub(super) tables: Vec<&'static [f64; 16]>,
    pub(super) looked_up: Vec<Vec<f64>>,
}

thread_local! {
    pub(super) static TAPE: RefCell<Tape> = RefCell::default();
}

/// An entry of the list; where it is `FINE`, elementary functions are recorded down to bits, else as calls.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Term<const FINE: bool>(pub(super) usize);

/// A truth value among the entries.
#[derive(Clone, Copy, Debug)]
pub struct Truth(usize);

fn put(kind: Kind, of: [usize; 3], bits: u64) -> usize {
    TAPE.with_borrow_mut(|tape| {
        let node = Node { kind, of, bits };
        let next = tape.nodes.len();
        let place = *tape.known.entry(node).or_insert(next);
        if place == next {
            tape.nodes.push(node);
        }
        place
    })
}

fn constant(value: f64) -> usize {
    // One NaN is as good as another.
    put(Kind::Constant, [0; 3], if value.is_nan() { f64::NAN.to_bits() } else { value.to_bits() })
}

fn bits_of(place: usize, wanted: Kind) -> Option<u64> {
    TAPE.with_borrow(|tape| {
        let Node { kind, bits, .. } = tape.nodes[place];
        (kind == wanted).then_some(bits)
    })
}

fn value_of(place: usize) -> Option<f64> {
    bits_of(place, Kind::Constant).map(f64::from_bits)
}

fn table_of(table: &'static [f64; 16]) -> usize {
    TAPE.with_borrow_mut(|tape| {
        let number = tape.tables.iter().position(|&known| core::ptr::eq(known, table));
        number.unwrap_or_else(|| {
            tape.tables.push(table);
            tape.tables.len() - 1
        })
    })
}

fn one(kind: Kind, a: usize, fold: fn(f64) -> f64) -> usize {
    value_of(a).map_or_else(|| put(kind, [a, 0, 0], 0), |a| constant(fold(a)))
}

#[allow(clippy::float_cmp)] // a product with exactly one
fn two(kind: Kind, a: usize, b: usize, fold: fn(f64, f64) -> f64) -> usize {
    match (kind, value_of(a), value_of(b)) {
        (_, Some(a), Some(b)) => constant(fold(a, b)),
        (Kind::Mul, Some(1.0), _) => b,
        (Kind::Mul, _, Some(1.0)) => a,
        _ => put(kind, [a, b, 0], 0),
    }
}

impl<const FINE: bool> Term<FINE> {
    /// The input of that number.
    pub(super) fn input(number: usize) -> Self {
        Self(put(Kind::Input, [0; 3], number as u64))
    }

    /// Its value, if that is known.
    pub(crate) fn value(self) -> Option<f64> {
        value_of(self.0)
    }
}

impl Lanes for Term<false> {
    const WIDTH: usize = 1;
    fn from_fn(mut value: impl FnMut(usize) -> f64) -> Self {
        <Self as Real>::splat(value(0))
    }
    /// What is not known is not a number.
    fn for_each(self, mut receive: impl FnMut(usize, f64)) {
        receive(0, self.value().unwrap_or(f64::NAN));
    }
    fn cell(self, most: usize) -> Self {
        Self(put(Kind::Cell, [self.0, 0, 0], most as u64))
    }
    #[allow(clippy::float_cmp)] // the same table
    fn looked_up(self, table: &[f64]) -> Self {
        let number = TAPE.with_borrow_mut(|tape| {
            let known = tape.looked_up.iter().position(|known| known == table);
            known.unwrap_or_else(|| {
                tape.looked_up.push(table.to_vec());
                tape.looked_up.len() - 1
            })
        });
        Self(put(Kind::LookUp, [self.0, number, 0], 0))
    }
}

macro_rules! operator {
    ($trait:ident $method:ident) => {
        impl<const FINE: bool> $trait for Term<FINE> {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(two(Kind::$trait, self.0, other.0, |a, b| a.$method(b)))
            }
        }
    };
}
operator!(Add add);
operator!(Sub sub);
operator!(Mul mul);
operator!(Div div);

impl<const FINE: bool> Neg for Term<FINE> {
    type Output = Self;
    fn neg(self) -> Self {
        Self(one(Kind::Neg, self.0, |a| -a))
    }
}

impl<const FINE: bool> Real for Term<FINE>
where
    Self: Elementary,
{
    type Mask = Truth;
    type Piece = Self;
    const PIECES: usize = 1;
    fn piece(&self, _: usize) -> Self {
        *self
    }
    fn set_piece(&mut self, _: usize, piece: Self) {
        *self = piece;
    }

    fn splat(value: f64) -> Self {
        Self(constant(value))
    }
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        match (self.value(), factor.value(), addend.value()) {
            (Some(a), Some(b), Some(c)) => Self::splat(a.mul_add(b, c)),
            _ => Self(put(Kind::Fma, [self.0, factor.0, addend.0], 0)),
        }
    }
    fn abs(self) -> Self {
        Self(one(Kind::Abs, self.0, f64::abs))
    }
    fn sqrt(self) -> Self {
        Self(one(Kind::Sqrt, self.0, f64::sqrt))
    }
    fn copysign(self, sign: Self) -> Self {
        Self(two(Kind::CopySign, self.0, sign.0, f64::copysign))
    }
    fn by_sign(self, positive: Self, negative: Self) -> Self {
        match self.value() {
            Some(value) if value.is_sign_negative() => negative,
            Some(_) => positive,
            None if positive == negative => positive,
            None => Self(put(Kind::BySign, [self.0, positive.0, negative.0], 0)),
        }
    }
    fn min(self, other: Self) -> Self {
        Self(two(Kind::Min, self.0, other.0, <f64 as Real>::min))
    }
    fn max(self, other: Self) -> Self {
        Self(two(Kind::Max, self.0, other.0, <f64 as Real>::max))
    }
    fn round_ties_even(self) -> Self {
        Self(one(Kind::Round, self.0, f64::round_ties_even))
    }
    fn less(self, other: Self) -> Truth {
        compared(Kind::Less, self.0, other.0, <f64 as Real>::less)
    }
    fn equal(self, other: Self) -> Truth {
        compared(Kind::Equal, self.0, other.0, <f64 as Real>::equal)
    }
    fn select(mask: Truth, yes: Self, no: Self) -> Self {
        match mask.known() {
            Some(true) => yes,
            Some(false) => no,
            None if yes == no => yes,
            None => Self(put(Kind::Select, [mask.0, yes.0, no.0], 0)),
        }
    }
    fn out_of_line<W: OutOfLine>(work: W) {
        work.run();
    }
    // What is not known while recording takes the long way, which gives the same bits.
    fn all(mask: Truth) -> bool {
        mask.known() == Some(true)
    }
    fn any(mask: Truth) -> bool {
        mask.known() != Some(false)
    }
}

fn compared(kind: Kind, a: usize, b: usize, fold: fn(f64, f64) -> bool) -> Truth {
    Truth(match (value_of(a), value_of(b)) {
        (Some(a), Some(b)) => put(Kind::Truth, [0; 3], u64::from(fold(a, b))),
        _ => put(kind, [a, b, 0], 0),
    })
}

impl Truth {
    fn known(self) -> Option<bool> {
        bits_of(self.0, Kind::Truth).map(|bits| bits != 0)
    }
}

impl Elementary for Term<false> {
    fn exponential(self) -> Self {
        Self(one(Kind::Exp, self.0, exp))
    }
    fn logarithm(self) -> Self {
        Self(one(Kind::Ln, self.0, ln))
    }
    fn power(self, exponent: &Exponent<Self>) -> Self {
        Self(two(Kind::Pow, self.0, exponent.n.0, |x, n| powf(x, &Exponent::of(n))))
    }
    fn hyperbolic_tangent(self) -> Self {
        Self(one(Kind::Tanh, self.0, tanh))
    }
}

impl Bits for Term<true> {
    fn octave(self) -> (Self, Self, Self) {
        let part = |kind| Self(put(kind, [self.0, 0, 0], 0));
        (part(Kind::Exponent), part(Kind::Mantissa), part(Kind::Sixteenth))
    }
    fn entry_of(self, table: &'static [f64; 16]) -> Self {
        Self(put(Kind::Entry, [self.0, table_of(table), 0], 0))
    }
    fn pair_of(self, pairs: &'static Pairs) -> (Self, Self) {
        (self.entry_of(&pairs.first), self.entry_of(&pairs.second))
    }
    fn half_of_two_to(k: Self) -> Self {
        Self(put(Kind::HalfTwo, [k.0, 0, 0], 0))
    }
    fn times_two_to(self, aligned: Self) -> Self {
        Self(put(Kind::TimesTwo, [self.0, aligned.0, 0], 0))
    }
}
