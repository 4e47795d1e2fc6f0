//! The number a model computes with: one `f64`, or a pack of lanes that holds one candidate each.
//!
//! A model written over `R: Real` is one text for both. Nothing here is contracted or reordered by the
//! compiler: a fused multiply-add happens where `mul_add` is written and nowhere else, so a lane gives the
//! bits that the scalar gives, on every instruction set.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A real number, or several side by side; every operation is lane by lane and correctly rounded.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// One truth value per lane.
    type Mask: Copy;

    /// The same value in every lane.
    fn splat(value: f64) -> Self;
    /// `self * factor + addend`, rounded once.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// Magnitude of `self` with the sign bit of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// Nearest integral value, ties to even.
    fn round_ties_even(self) -> Self;
    /// `self < other`; false where either is NaN.
    fn less(self, other: Self) -> Self::Mask;
    /// `self == other`; false where either is NaN.
    fn equal(self, other: Self) -> Self::Mask;
    /// Lanes of `yes` where the mask holds, of `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Whether the mask holds in every lane.
    fn all(mask: Self::Mask) -> bool;
    /// Whether the mask holds in at least one lane.
    fn any(mask: Self::Mask) -> bool;
    /// For a positive normal number `m * 2^e` with `1/sqrt(2) <= m < sqrt(2)`: `(e, m)`, the exponent as a real.
    fn exponent_and_mantissa(self) -> (Self, Self);
    /// `self * 2^k` for integral `k`, by adding to the exponent bits; `self` and the result must be normal.
    fn times_two_to(self, k: Self) -> Self;
}

impl Real for f64 {
    type Mask = bool;

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
    fn copysign(self, sign: Self) -> Self {
        f64::copysign(self, sign)
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
    fn all(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn any(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn exponent_and_mantissa(self) -> (Self, Self) {
        // Shifting 1/sqrt(2) to 1 first makes the exponent step there.
        let bits = self.to_bits().wrapping_add(ONE_BITS - SQRT_HALF_BITS);
        let exponent = f64::from_bits((bits >> 52) | TWO_TO_52) - EXPONENT_BIAS_AT_TWO_TO_52;
        let mantissa = f64::from_bits((bits & MANTISSA_BITS) + SQRT_HALF_BITS);
        (exponent, mantissa)
    }
    #[inline(always)]
    fn times_two_to(self, k: Self) -> Self {
        let shifted = (k + INTEGER_ALIGNER).to_bits() << 52;
        f64::from_bits(self.to_bits().wrapping_add(shifted))
    }
}

/// Bits of 2^52: an integer below 2^52 or-ed into them reads as 2^52 plus that integer.
pub(crate) const TWO_TO_52: u64 = 0x4330_0000_0000_0000;
/// 2^52 + 1023: taking it away leaves the unbiased exponent.
pub(crate) const EXPONENT_BIAS_AT_TWO_TO_52: f64 = 4_503_599_627_371_519.0;
/// The fraction field of a double.
pub(crate) const MANTISSA_BITS: u64 = 0x000F_FFFF_FFFF_FFFF;
/// Bits of 1.0.
pub(crate) const ONE_BITS: u64 = 0x3FF0_0000_0000_0000;
/// Bits of 1/sqrt(2).
pub(crate) const SQRT_HALF_BITS: u64 = 0x3FE6_A09E_667F_3BCD;
/// 1.5 * 2^52: added to a small integral number, it leaves that integer in the low bits.
pub(crate) const INTEGER_ALIGNER: f64 = 6_755_399_441_055_744.0;
