//! Lanes: eight candidates in one vector, several vectors in one pack.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::elementary::{
    BinaryExponent, beside_sixteenth, power_and_logarithm, power_of_two, rounded_exponent,
};
use crate::real::{Bits, OutOfLine, Pairs, Real};

/// Candidates in one vector.
pub const VECTOR_WIDTH: usize = 8;

/// Lanes of the widest pack.
pub(crate) const MOST_LANES: usize = 32;

/// A real number with several lanes.
pub trait Lanes: Real {
    /// Number of lanes.
    const WIDTH: usize;
    /// Lane `i` holds `value(i)`.
    fn from_fn(value: impl FnMut(usize) -> f64) -> Self;
    /// Calls `receive(i, value)` for every lane, in order.
    fn for_each(self, receive: impl FnMut(usize, f64));
    /// The whole number at or below it, from 0 to `most`; 0 where it is not a number.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)] // small counts
    fn cell(self, most: usize) -> Self {
        let mut cells = [0.0; MOST_LANES];
        self.for_each(|lane, place| cells[lane] = (place as usize).min(most) as f64);
        Self::from_fn(|lane| cells[lane])
    }
    /// The entry of a table at this place, a whole number within it.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place in a table
    fn looked_up(self, table: &[f64]) -> Self {
        let mut entries = [0.0; MOST_LANES];
        self.for_each(|lane, place| entries[lane] = table[place as usize]);
        Self::from_fn(|lane| entries[lane])
    }
    /// The same value with the derivatives `slope(i, k)` of lane i along direction k; a plain number has none.
    #[inline(always)]
    fn with_slopes(self, _slope: impl FnMut(usize, usize) -> f64) -> Self {
        self
    }
    /// Calls `receive(i, k, derivative)` for every lane and direction.
    #[inline(always)]
    fn for_each_slope(self, _receive: impl FnMut(usize, usize, f64)) {}
}

impl Lanes for f64 {
    const WIDTH: usize = 1;
    #[inline(always)]
    fn from_fn(mut value: impl FnMut(usize) -> f64) -> Self {
        value(0)
    }
    #[inline(always)]
    fn for_each(self, mut receive: impl FnMut(usize, f64)) {
        receive(0, self);
    }
}

/// `GROUPS` vectors side by side: independent chains of arithmetic that hide each other's latency.
#[derive(Clone, Copy)]
pub struct Pack<V, const GROUPS: usize>([V; GROUPS]);

/// Applies an expression to every group `$g`. A loop rather than a closure: a closure is compiled without the
/// caller's instruction set, and keeps the intrinsics inside it from being inlined.
macro_rules! each_group {
    ($g:ident => $value:expr, from $start:expr) => {{
        let mut groups = $start;
        let mut $g = 0;
        while $g < GROUPS {
            groups[$g] = $value;
            $g += 1;
        }
        groups
    }};
}

macro_rules! operator {
    ($trait:ident $method:ident) => {
        impl<V: Real, const GROUPS: usize> $trait for Pack<V, GROUPS> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(each_group!(g => self.0[g].$method(other.0[g]), from self.0))
            }
        }
    };
}
operator!(Add add);
operator!(Sub sub);
operator!(Mul mul);
operator!(Div div);

impl<V: Real, const GROUPS: usize> Neg for Pack<V, GROUPS> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(each_group!(g => -self.0[g], from self.0))
    }
}

impl<V: Bits, const GROUPS: usize> Real for Pack<V, GROUPS> {
    type Mask = [V::Mask; GROUPS];
    type Piece = V;
    const PIECES: usize = GROUPS;
    #[inline(always)]
    fn piece(&self, number: usize) -> V {
        self.0[number]
    }
    #[inline(always)]
    fn set_piece(&mut self, number: usize, piece: V) {
        self.0[number] = piece;
    }

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([V::splat(value); GROUPS])
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(each_group!(g => self.0[g].mul_add(factor.0[g], addend.0[g]), from self.0))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(each_group!(g => self.0[g].abs(), from self.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(each_group!(g => self.0[g].sqrt(), from self.0))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self(each_group!(g => self.0[g].copysign(sign.0[g]), from self.0))
    }
    #[inline(always)]
    fn by_sign(self, positive: Self, negative: Self) -> Self {
        Self(each_group!(g => self.0[g].by_sign(positive.0[g], negative.0[g]), from self.0))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(each_group!(g => self.0[g].min(other.0[g]), from self.0))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(each_group!(g => self.0[g].max(other.0[g]), from self.0))
    }
    #[inline(always)]
    fn round_ties_even(self) -> Self {
        Self(each_group!(g => self.0[g].round_ties_even(), from self.0))
    }
    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        each_group!(g => self.0[g].less(other.0[g]), from [self.0[0].less(other.0[0]); GROUPS])
    }
    #[inline(always)]
    fn equal(self, other: Self) -> Self::Mask {
        each_group!(g => self.0[g].equal(other.0[g]), from [self.0[0].equal(other.0[0]); GROUPS])
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(each_group!(g => V::select(mask[g], yes.0[g], no.0[g]), from yes.0))
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        let mut all = true;
        for group in mask {
            all &= V::all(group);
        }
        all
    }
    #[inline(always)]
    fn out_of_line<W: OutOfLine>(work: W) {
        V::out_of_line(work);
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        let mut any = false;
        for group in mask {
            any |= V::any(group);
        }
        any
    }
}

impl<V: Bits, const GROUPS: usize> Bits for Pack<V, GROUPS> {
    #[inline(always)]
    fn octave(self) -> (Self, Self, Self) {
        (
            Self(each_group!(g => self.0[g].octave().0, from self.0)),
            Self(each_group!(g => self.0[g].octave().1, from self.0)),
            Self(each_group!(g => self.0[g].octave().2, from self.0)),
        )
    }
    #[inline(always)]
    fn entry_of(self, table: &'static [f64; 16]) -> Self {
        Self(each_group!(g => self.0[g].entry_of(table), from self.0))
    }
    #[inline(always)]
    fn pair_of(self, pairs: &'static Pairs) -> (Self, Self) {
        let (mut first, mut second) = (self.0, self.0);
        for g in 0..GROUPS {
            (first[g], second[g]) = self.0[g].pair_of(pairs);
        }
        (Self(first), Self(second))
    }
    #[inline(always)]
    fn half_of_two_to(k: Self) -> Self {
        Self(each_group!(g => V::half_of_two_to(k.0[g]), from k.0))
    }
    #[inline(always)]
    fn times_two_to(self, aligned: Self) -> Self {
        Self(each_group!(g => self.0[g].times_two_to(aligned.0[g]), from self.0))
    }
    #[inline(always)]
    fn zero_where(mask: Self::Mask, number: Self) -> Self {
        Self(each_group!(g => V::zero_where(mask[g], number.0[g]), from number.0))
    }

    /// Where the vectors outnumber the registers, in three parts, each for one vector after the other: what a part of one
    /// vector needs stays in registers, and the parts of the next vectors hide its latency.
    #[inline(always)]
    fn general_power(self, n: Self) -> Self {
        if const { GROUPS <= 2 || !V::FEW_REGISTERS } {
            return power_and_logarithm(self, n).0;
        }
        let zero = V::splat(0.0);
        let mut parts = [(zero, zero); GROUPS];
        let mut exponents = [BinaryExponent { aligned: zero, f: zero }; GROUPS];
        let mut g = 0;
        while g < GROUPS {
            parts[g] = beside_sixteenth(self.0[g]);
            g += 1;
        }
        for g in 0..GROUPS {
            (_, exponents[g]) = rounded_exponent(parts[g].0, parts[g].1, n.0[g]);
        }
        let mut g = 0;
        while g < GROUPS {
            // In place: what is overwritten here is not set up before.
            exponents[g].f = power_of_two(exponents[g]);
            g += 1;
        }
        Self(each_group!(g => exponents[g].f, from self.0))
    }
}

impl<V: Lanes + Bits, const GROUPS: usize> Lanes for Pack<V, GROUPS> {
    const WIDTH: usize = V::WIDTH * GROUPS;
    #[inline(always)]
    fn from_fn(mut value: impl FnMut(usize) -> f64) -> Self {
        let mut groups = [V::splat(0.0); GROUPS];
        for (group, vector) in groups.iter_mut().enumerate() {
            *vector = V::from_fn(|lane| value(group * V::WIDTH + lane));
        }
        Self(groups)
    }
    #[inline(always)]
    fn for_each(self, mut receive: impl FnMut(usize, f64)) {
        for (group, vector) in self.0.into_iter().enumerate() {
            vector.for_each(|lane, value| receive(group * V::WIDTH + lane, value));
        }
    }
}
