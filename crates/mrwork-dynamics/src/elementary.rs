//! Exponential, logarithm, real power and hyperbolic tangent of lanes.
//!
//! Every function is one straight line of arithmetic over [`Bits`]: tables of sixteen that fit in two vectors, and no
//! branch other than the whole exponents of [`powf`]. A lane therefore gives the bits of the scalar, on every
//! instruction set. A dual number takes the chain rule instead ([`Elementary`]).
//!
//! Subnormal numbers count as zero: as argument of [`ln`] and [`powf`] (but for its whole exponents, which are
//! products). Results of [`exp`] and [`powf`] below 2^-1020 count as zero too. NaN goes in and comes out.

mod tables;

use core::f64::consts::{LN_2, LOG2_E};

use crate::real::{Bits, Pairs, Real, SIXTEENTH_ALIGNER};
use tables::{
    BINARY_EXPONENTIAL, BINARY_LOGARITHM, EXPONENTIAL, LOGARITHM, OCTAVE_LOGARITHMS, RECIPROCALS,
    SIXTEENTH_ROOTS,
};

/// Reciprocals and logarithms of the sixteenths of an octave.
static SIXTEENTHS: Pairs = Pairs::of(RECIPROCALS, OCTAVE_LOGARITHMS);

/// ln 2 less the double nearest to it.
const LN_2_TAIL: f64 = 2.319_046_813_846_299_6e-17;
/// log2 e less the double nearest to it.
const LOG2_E_TAIL: f64 = 2.035_527_374_093_103_3e-17;

/// 1024 ln 2 less a few units in the last place: `exp` of a larger argument is infinite.
const LARGEST_EXPONENT: f64 = 709.782_712_893_383_4;
/// Powers with a smaller binary exponent count as zero: [`Real::times_two_to`] asks for results well above subnormal.
const SMALLEST_BINARY_EXPONENT: f64 = -1020.0;

/// How a kind of number takes the elementary functions; models call [`exp`], [`ln`], [`powf`] and [`tanh`].
pub trait Elementary: Sized {
    /// See [`exp`].
    fn exponential(self) -> Self;
    /// See [`ln`].
    fn logarithm(self) -> Self;
    /// See [`powf`].
    fn power(self, exponent: &Exponent<Self>) -> Self
    where
        Self: Real;
    /// See [`tanh`].
    fn hyperbolic_tangent(self) -> Self;
}

impl<R: Bits> Elementary for R {
    #[inline(always)]
    fn exponential(self) -> Self {
        exponential_of(self)
    }
    #[inline(always)]
    fn logarithm(self) -> Self {
        logarithm_of(self)
    }
    #[inline(always)]
    fn power(self, exponent: &Exponent<Self>) -> Self {
        let &Exponent { n, whole, all_two, all_whole, any_whole } = exponent;
        if all_two {
            return self * self;
        }
        if all_whole {
            return whole_power(self, n);
        }
        let general = self.general_power(n);
        if any_whole { R::select(whole, whole_power(self, n), general) } else { general }
    }
    #[inline(always)]
    fn hyperbolic_tangent(self) -> Self {
        tangent_of(self)
    }
}

/// Exponential e^x.
///
/// At most 1.2 units in the last place off; 0 below -707.03, infinite above 709.78.
#[inline(always)]
pub fn exp<R: Real>(x: R) -> R {
    x.exponential()
}

#[inline(always)]
fn exponential_of<R: Bits>(x: R) -> R {
    let high = R::splat(LOG2_E);
    let (t, aligned) = sixteenths(x, high);
    let f = x.mul_add(R::splat(LOG2_E_TAIL), x.mul_add(high, -t));
    let power = power_of_two(BinaryExponent { aligned, f });
    R::select(x.less(R::splat(LARGEST_EXPONENT)), power, x + R::splat(f64::INFINITY))
}

/// Natural logarithm ln x.
///
/// At most 1 unit in the last place off; -infinity for zero and for subnormal numbers, NaN for negative ones.
#[inline(always)]
pub fn ln<R: Real>(x: R) -> R {
    x.logarithm()
}

#[inline(always)]
fn logarithm_of<R: Bits>(x: R) -> R {
    // x = 2^e m with 1/sqrt(2) <= m < sqrt(2): ln x = e ln 2 + 2 artanh((m - 1)/(m + 1)).
    let one = R::splat(1.0);
    let (e, m, _) = x.octave();

    // s is rounded, and so is its denominator. The remainder f - s (2 + f) says by how much s fell short,
    // and ds = remainder/(2 + f) = remainder (1 - s)/2 needs no second division.
    let f = m - one;
    let s = f / (m + one);
    let remainder = (-s).mul_add(f, s.mul_add(R::splat(-2.0), f));

    // e ln 2 + 2 s = high + low, exact but for the last term: 2 s is smaller than ln 2.
    let twice = s + s;
    let high = e.mul_add(R::splat(LN_2), twice);
    let rounded_off = twice - e.mul_add(R::splat(-LN_2), high);
    let low = (-remainder).mul_add(s, rounded_off + remainder);

    let [c0, c1, c2, c3, c4, c5, c6] = LOGARITHM;
    let z = s * s;
    let z_2 = z * z;
    let higher = z_2.mul_add(R::splat(c6), line(z, c4, c5));
    let series = z_2.mul_add(z_2.mul_add(higher, line(z, c2, c3)), line(z, c0, c1));
    let low = (s * z).mul_add(series, low);
    let value = high + e.mul_add(R::splat(LN_2_TAIL), low);

    let value = R::select(x.less(R::splat(f64::INFINITY)), value, x);
    let value = R::select(x.less(R::splat(f64::MIN_POSITIVE)), R::splat(f64::NEG_INFINITY), value);
    R::select(x.less(R::splat(0.0)), R::splat(f64::NAN), value)
}

/// An exponent n >= 1 of [`powf`], one for each lane, and what can be said of it before any base is known.
#[derive(Clone, Copy)]
pub struct Exponent<R: Real> {
    pub(crate) n: R,
    /// Whether n is exactly 1, 2 or 3.
    pub(crate) whole: R::Mask,
    all_two: bool,
    all_whole: bool,
    any_whole: bool,
}

impl<R: Real> Exponent<R> {
    /// Examines n.
    #[inline(always)]
    pub fn of(n: R) -> Self {
        let two = R::splat(2.0);
        let near = (n - two).abs().less(R::splat(1.5));
        let whole = R::select(near, n.round_ties_even(), R::splat(f64::NAN)).equal(n);
        Self { n, whole, all_two: R::all(n.equal(two)), all_whole: R::all(whole), any_whole: R::any(whole) }
    }

    /// Whether it is 2 in every lane, and nobody asks for derivatives along it: powers are squares.
    #[inline(always)]
    pub fn is_two(&self) -> bool {
        !R::HAS_DERIVATIVES && self.all_two
    }
}

/// Power x^n of a magnitude x (no sign bit).
///
/// At most 1.5 units in the last place off for n <= 10 wherever the result is above 2^-1020; 0 below. An exponent of
/// exactly 1, 2 or 3 gives x, x x or (x x) x to the last bit, whatever the other lanes hold; where all lanes have one
/// of these, nothing else is computed. An infinite base and a NaN give a result that is not finite. No state of a model
/// asks for a negative base or a smaller exponent, and they are not looked for.
#[inline(always)]
pub fn powf<R: Real>(x: R, exponent: &Exponent<R>) -> R {
    x.power(exponent)
}

/// x^n for a magnitude x and any n >= 1, and log2 x; for zero a large negative number, so that their product is zero.
#[inline(always)]
pub(crate) fn power_and_logarithm<R: Bits>(x: R, n: R) -> (R, R) {
    let (high, r) = beside_sixteenth(x);
    let (logarithm, exponent) = rounded_exponent(high, r, n);
    (power_of_two(exponent), logarithm)
}

/// log2 of the sixteenth of an octave in which a magnitude x lies, and r for the rest: log2 x is their sum with
/// log2(1 + r).
#[inline(always)]
pub(crate) fn beside_sixteenth<R: Bits>(x: R) -> (R, R) {
    // x = 2^e m, and c m = 1 + r with the reciprocal c of the middle of m's sixteenth of the octave:
    // log2 x = (e - log2 c) + log2(1 + r), where the first sum is exact and r is rounded once.
    // The bits of 0 and of infinity read as 2^-1023 and 2^1024, whose powers fall out of range by themselves.
    let (e, m, sixteenth) = x.octave();
    let (reciprocal, logarithm) = sixteenth.pair_of(&SIXTEENTHS);
    (e + logarithm, reciprocal.mul_add(m, R::splat(-1.0)))
}

/// log2 x of the parts of [`beside_sixteenth`], and n times it as the exponent of a power of two.
#[inline(always)]
pub(crate) fn rounded_exponent<R: Bits>(high: R, r: R, n: R) -> (R, BinaryExponent<R>) {
    let low = r * binary_logarithm(r);
    let logarithm = high + low;
    let (t, aligned) = sixteenths(logarithm, n);
    (logarithm, BinaryExponent { aligned, f: n.mul_add(low, n.mul_add(high, -t)) })
}

/// x^n for n = 1, 2 or 3, as products.
#[inline(always)]
pub(crate) fn whole_power<R: Real>(x: R, n: R) -> R {
    let one = R::splat(1.0);
    let second = R::select(one.less(n), x, one);
    let third = R::select(R::splat(2.0).less(n), x, one);
    x * second * third
}

/// Hyperbolic tangent h/(1 + h), h = (e^(2|x|) - 1)/2, with the sign of x.
///
/// Less than 2 units in the last place off, odd, and +-1 for |x| > 20.
#[inline(always)]
pub fn tanh<R: Real>(x: R) -> R {
    x.hyperbolic_tangent()
}

#[inline(always)]
fn tangent_of<R: Bits>(x: R) -> R {
    let one = R::splat(1.0);
    let half = R::splat(0.5);
    let size = R::splat(20.0).min(x.abs());
    let doubled = size + size;

    // 2 h = 2^k (e^r - 1) + (2^k - 1) keeps its relative accuracy down to the smallest x, where k = 0.
    // For k = 1 the subtraction cancels; so 2^k r + (2^k - 1), which is exact there, is formed first.
    let k = (doubled * R::splat(LOG2_E)).round_ties_even();
    let r = k.mul_add(R::splat(-LN_2), doubled);
    let tail = k * R::splat(-LN_2_TAIL);
    let scale = R::half_of_two_to(k);
    let linear = scale.mul_add(r, scale - half);
    let h = scale.mul_add(above_linear(r, tail), linear);

    // h/(1 + h) = h - h^2/(1 + h) = 1 - 1/(1 + h): the quotient is the smaller term, and so is its error.
    let small = h.less(R::splat(0.75));
    let larger = R::select(small, h, one);
    let smaller = R::select(small, h * h, one) / (one + h);
    (larger - smaller).copysign(x)
}

/// log2(1 + r)/r.
#[inline(always)]
fn binary_logarithm<R: Real>(r: R) -> R {
    let [c1, c2, c3, c4, c5, c6, c7, c8, c9] = BINARY_LOGARITHM;
    let s = r * r;
    let odd = s.mul_add(s.mul_add(s.mul_add(line(s, c7, c9), R::splat(c5)), R::splat(c3)), R::splat(c1));
    let even = s.mul_add(s.mul_add(line(s, c6, c8), R::splat(c4)), R::splat(c2));
    r.mul_add(even, odd)
}

/// t + f with |f| <= 1/32, where t is in sixteenths.
#[derive(Clone, Copy)]
pub(crate) struct BinaryExponent<R> {
    /// t plus [`SIXTEENTH_ALIGNER`].
    pub(crate) aligned: R,
    pub(crate) f: R,
}

/// `x factor` rounded to sixteenths, as it is and with the count of sixteenths in its low bits.
#[inline(always)]
fn sixteenths<R: Real>(x: R, factor: R) -> (R, R) {
    let aligner = R::splat(SIXTEENTH_ALIGNER);
    let aligned = x.mul_add(factor, aligner);
    (aligned - aligner, aligned)
}

/// 2^(t + f); 0 where t is too small.
#[inline(always)]
pub(crate) fn power_of_two<R: Bits>(BinaryExponent { aligned, f }: BinaryExponent<R>) -> R {
    let [c1, c2, c3, c4, c5, c6] = BINARY_EXPONENTIAL;
    let root = aligned.entry_of(&SIXTEENTH_ROOTS);
    let s = f * f;
    let odd = s.mul_add(line(s, c3, c5), R::splat(c1));
    let even = s.mul_add(line(s, c4, c6), R::splat(c2));
    let power = (root * f).mul_add(f.mul_add(even, odd), root).times_two_to(aligned);
    R::zero_where(aligned.less(R::splat(SIXTEENTH_ALIGNER + SMALLEST_BINARY_EXPONENT)), power)
}

/// e^r - 1 - r + tail.
#[inline(always)]
fn above_linear<R: Real>(r: R, tail: R) -> R {
    let [c0, c1, c2, c3, c4, c5, c6, c7, c8, c9] = EXPONENTIAL;
    let s = r * r;
    let even = s.mul_add(s.mul_add(s.mul_add(line(s, c6, c8), R::splat(c4)), R::splat(c2)), R::splat(c0));
    let odd = s.mul_add(s.mul_add(s.mul_add(line(s, c7, c9), R::splat(c5)), R::splat(c3)), R::splat(c1));
    s.mul_add(r.mul_add(odd, even), tail)
}

/// constant + slope x.
#[inline(always)]
fn line<R: Real>(x: R, constant: f64, slope: f64) -> R {
    x.mul_add(R::splat(slope), R::splat(constant))
}
