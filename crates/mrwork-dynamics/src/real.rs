//! The number a model computes with: one `f64`, a pack of lanes that holds one candidate each, or a dual number that
//! carries derivatives along.
//!
//! A model written over `R: Real` is one text for all. Nothing here is contracted or reordered by the
//! compiler: a fused multiply-add happens where `mul_add` is written and nowhere else, so a lane gives the
//! bits that the scalar gives, on every instruction set.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::elementary::{Elementary, power_and_logarithm};

/// A real number, or several side by side; every operation is lane by lane and correctly rounded.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Elementary
{
    /// One truth value per lane.
    type Mask: Copy;
    /// One of the vectors that it is made of.
    type Piece: Real;
    /// Number of vectors.
    const PIECES: usize;
    /// The vector of that number.
    fn piece(&self, number: usize) -> Self::Piece;
    /// Replaces the vector of that number.
    fn set_piece(&mut self, number: usize, piece: Self::Piece);
    /// Whether it carries derivatives, so that a shortcut that is right for values alone is not taken.
    const HAS_DERIVATIVES: bool = false;

    /// The same value in every lane.
    fn splat(value: f64) -> Self;
    /// `self * factor + addend`, rounded once.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// The same for a factor without derivatives.
    #[inline(always)]
    fn weighted(self, weight: Self, addend: Self) -> Self {
        self.mul_add(weight, addend)
    }
    /// Magnitude.
    fn abs(self) -> Self;
    /// Square root; not a number below zero.
    fn sqrt(self) -> Self;
    /// Magnitude of `self` with the sign bit of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// Lanes of `positive` where the sign bit of `self` is clear, of `negative` where it is set.
    fn by_sign(self, positive: Self, negative: Self) -> Self;
    /// The smaller of the two; `other` where either is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger of the two; `other` where either is NaN.
    fn max(self, other: Self) -> Self;
    /// Nearest integral value, ties to even.
    fn round_ties_even(self) -> Self;
    /// `self < other`; false where either is NaN.
    fn less(self, other: Self) -> Self::Mask;
    /// `self == other`; false where either is NaN.
    fn equal(self, other: Self) -> Self::Mask;
    /// Lanes of `yes` where the mask holds, of `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// The value alone; it differs for dual numbers, which lose their derivatives.
    #[inline(always)]
    fn without_derivatives(self) -> Self {
        self
    }
    /// Calls `work` in a function that is not inlined, compiled for the same instruction set.
    fn out_of_line<W: OutOfLine>(work: W);
    /// Whether the mask holds in every lane.
    fn all(mask: Self::Mask) -> bool;
    /// Whether the mask holds in at least one lane.
    fn any(mask: Self::Mask) -> bool;
}

/// An out-of-line call: work in lanes that is compiled once instead of inlined into every loop.
pub trait OutOfLine {
    /// The type in whose module the work is compiled: modules are compiled side by side, so each damper has its own.
    type Home;
    /// Runs the work. Must be `#[inline(always)]`, and so must all functions that it calls.
    fn run(self);
}

/// A real number whose exponent and fraction can be taken apart, which is what elementary functions are made of.
pub trait Bits: Real {
    /// Whether a vector has so few registers that a wide pack takes a power in parts.
    const FEW_REGISTERS: bool = false;

    /// For a positive normal number `m * 2^e` with `1/sqrt(2) <= m < sqrt(2)`: `(e, m, j)`, the exponent as a real, and
    /// the sixteenth of the octave in which m lies, counted by bit patterns, in the low four bits of j.
    fn octave(self) -> (Self, Self, Self);
    /// The entry that the low four bits of `self` number.
    fn entry_of(self, table: &'static [f64; 16]) -> Self;
    /// The pair of entries that the low four bits of `self` number.
    fn pair_of(self, pairs: &'static Pairs) -> (Self, Self);
    /// 2^k / 2 for whole k from -1021 to 1024.
    fn half_of_two_to(k: Self) -> Self;
    /// `self * 2^floor(k)` for k in sixteenths, infinite where that is too large; `self` must lie between 1/2 and 2, and
    /// the result must not be below 2^-1021. `aligned` is k plus [`SIXTEENTH_ALIGNER`].
    fn times_two_to(self, aligned: Self) -> Self;
    /// `number`; zero where the mask holds.
    #[inline(always)]
    fn zero_where(mask: Self::Mask, number: Self) -> Self {
        Self::select(mask, Self::splat(0.0), number)
    }
    /// `self^n` for any n >= 1, see [`crate::elementary::powf`].
    #[inline(always)]
    fn general_power(self, n: Self) -> Self {
        power_and_logarithm(self, n).0
    }
}

/// Two tables of sixteen, apart and side by side: vectors of 512 bits hold a table in two registers, narrower ones find
/// both entries of a lane by one load.
#[repr(align(64))]
pub struct Pairs {
    /// The first of each pair.
    pub first: [f64; 16],
    /// The second of each pair.
    pub second: [f64; 16],
    /// Both, one pair after the other.
    pub side_by_side: [f64; 32],
}

impl Pairs {
    /// The pairs of two tables.
    #[must_use]
    pub const fn of(first: [f64; 16], second: [f64; 16]) -> Self {
        let mut side_by_side = [0.0; 32];
        let mut entry = 0;
        while entry < 16 {
            side_by_side[2 * entry] = first[entry];
            side_by_side[2 * entry + 1] = second[entry];
            entry += 1;
        }
        Self { first, second, side_by_side }
    }
}

impl Real for f64 {
    type Mask = bool;
    type Piece = Self;
    const PIECES: usize = 1;
    #[inline(always)]
    fn piece(&self, _: usize) -> Self {
        *self
    }
    #[inline(always)]
    fn set_piece(&mut self, _: usize, piece: Self) {
        *self = piece;
    }

    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        f64::mul_add(self, factor, addend)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        f64::copysign(self, sign)
    }
    #[inline(always)]
    fn by_sign(self, positive: Self, negative: Self) -> Self {
        if self.is_sign_negative() { negative } else { positive }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn round_ties_even(self) -> Self {
        f64::round_ties_even(self)
    }
    #[inline(always)]
    fn less(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    #[allow(clippy::float_cmp)] // exact comparison is what the name says
    fn equal(self, other: Self) -> bool {
        self == other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn out_of_line<W: OutOfLine>(work: W) {
        <W::Home as Plainly>::out_of_line(work);
    }
    #[inline(always)]
    fn all(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn any(mask: bool) -> bool {
        mask
    }
}

/// An out-of-line call without an instruction set of its own, compiled in the module of `Self`.
trait Plainly {
    #[inline(never)]
    fn out_of_line<W: OutOfLine>(work: W) {
        work.run();
    }
}

impl<T: ?Sized> Plainly for T {}

impl Bits for f64 {
    #[inline(always)]
    fn octave(self) -> (Self, Self, Self) {
        // Shifting 1/sqrt(2) to 1 first makes the exponent step there.
        let bits = self.to_bits().wrapping_add(ONE_BITS - SQRT_HALF_BITS);
        let exponent = f64::from_bits((bits >> 52) | TWO_TO_52) - EXPONENT_BIAS_AT_TWO_TO_52;
        let mantissa = f64::from_bits((bits & MANTISSA_BITS) + SQRT_HALF_BITS);
        (exponent, mantissa, f64::from_bits(bits >> 48))
    }
    #[inline(always)]
    fn entry_of(self, table: &'static [f64; 16]) -> Self {
        table[(self.to_bits() & 15) as usize]
    }
    #[inline(always)]
    fn pair_of(self, pairs: &'static Pairs) -> (Self, Self) {
        let entry = 2 * (self.to_bits() & 15) as usize;
        (pairs.side_by_side[entry], pairs.side_by_side[entry + 1])
    }
    #[inline(always)]
    fn half_of_two_to(k: Self) -> Self {
        f64::from_bits((k + HALF_EXPONENT_BIAS).to_bits() << 52)
    }
    #[inline(always)]
    fn times_two_to(self, aligned: Self) -> Self {
        // By adding to the exponent bits, and the last doubling as a product, which knows infinity.
        let floor = aligned.to_bits() >> 4;
        let half = f64::from_bits(self.to_bits().wrapping_add(floor << 52));
        if aligned < SIXTEENTH_ALIGNER + 1025.0 { half + half } else { f64::INFINITY }
    }
}

/// `yes` if `number` is above zero, else zero; not a number if `number` is not.
#[inline(always)]
pub(crate) fn where_positive<R: Real>(number: R, yes: R) -> R {
    let otherwise = if_known(number, R::splat(0.0));
    R::select(R::splat(0.0).less(number), yes, otherwise)
}

/// `value`; not a number if `by`, which it was chosen by, is not a number, which the comparison alone would hide.
#[inline(always)]
pub(crate) fn if_known<R: Real>(by: R, value: R) -> R {
    R::select(by.equal(by), value, R::splat(f64::NAN))
}

/// `number`; infinite where it is not a number.
#[inline(always)]
pub(crate) fn finite_or_infinite<R: Real>(number: R) -> R {
    let infinite = R::splat(f64::INFINITY);
    R::select(number.less(infinite), number, infinite)
}

/// `number` limited to the range from `lower` to `upper`.
#[inline(always)]
pub(crate) fn within<R: Real>(number: R, lower: R, upper: R) -> R {
    upper.min(lower.max(number))
}

/// Bits of 2^52: an integer below 2^52 or-ed into them reads as 2^52 plus that integer.
pub(crate) const TWO_TO_52: u64 = 0x4330_0000_0000_0000;
/// 2^52 + 1023: taking it away leaves the unbiased exponent.
pub(crate) const EXPONENT_BIAS_AT_TWO_TO_52: f64 = 4_503_599_627_371_519.0;
/// 2^52 + 1022: the low bits of a sum with it are the exponent field of 2^k / 2.
pub(crate) const HALF_EXPONENT_BIAS: f64 = EXPONENT_BIAS_AT_TWO_TO_52 - 1.0;
/// The fraction field of a double.
pub(crate) const MANTISSA_BITS: u64 = 0x000F_FFFF_FFFF_FFFF;
/// Bits of 1.0.
pub(crate) const ONE_BITS: u64 = 0x3FF0_0000_0000_0000;
/// Bits of 1/sqrt(2).
pub(crate) const SQRT_HALF_BITS: u64 = 0x3FE6_A09E_667F_3BCD;
/// 1.5 * 2^48 - 1: a number added to it is rounded to sixteenths, and their count, of the number less 1, stands in the low
/// bits.
pub const SIXTEENTH_ALIGNER: f64 = 422_212_465_065_983.0;
