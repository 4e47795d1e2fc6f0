//! Exponential, logarithm, real power and hyperbolic tangent of lanes.
//!
//! Every function is one straight line of arithmetic over [`Real`]: no table, and no branch other than the
//! whole exponents of [`powf`]. A lane therefore gives the bits of the scalar, on every instruction set.
//!
//! Subnormal numbers count as zero: as argument of [`ln`] and [`powf`] (but for its whole exponents, which
//! are products), and as result of [`exp`] and [`powf`]. NaN goes in and comes out.

use core::f64::consts::{LN_2, LOG2_E};

use crate::real::Real;

/// ln 2 less the double nearest to it.
const LN_2_TAIL: f64 = 2.319_046_813_846_299_6e-17;

/// 1024 ln 2 less a few units in the last place: `exp` of a larger argument is infinite.
const LARGEST_EXPONENT: f64 = 709.782_712_893_383_4;
/// -1022 ln 2, rounded up: `exp` of a smaller argument is subnormal, and counts as zero.
const SMALLEST_EXPONENT: f64 = -708.396_418_532_264;

/// Coefficients of (e^r - 1 - r)/r^2 as a polynomial in r, for |r| <= ln(2)/2.
///
/// Minimax in the relative error of e^r - 1, which is 2^-55.2; found by Lawson's reweighted least squares in
/// 50 digits, rounding one coefficient after another and refitting those of higher order.
const EXPONENTIAL: [f64; 10] = [
    0.5,
    0.166_666_666_666_666_02,
    0.041_666_666_666_619_86,
    0.008_333_333_333_388_407,
    0.001_388_888_892_057_128_5,
    0.000_198_412_697_092_704_82,
    2.480_151_625_291_822e-5,
    2.755_742_508_057_798_7e-6,
    2.762_227_113_685_149e-7,
    2.504_593_921_069_337e-8,
];

/// Coefficients of (2 artanh(s) - 2 s)/s^3 as a polynomial in s^2, for |s| <= (sqrt(2) - 1)/(sqrt(2) + 1).
///
/// Minimax in the absolute error of artanh, which is 2^-62; found by Remez exchange in 60 digits, rounding
/// one coefficient after another and refitting those of higher order.
const LOGARITHM: [f64; 7] = [
    0.666_666_666_666_681,
    0.399_999_999_990_162,
    0.285_714_288_181_593_1,
    0.222_221_916_742_675_6,
    0.181_838_900_048_066_27,
    0.153_063_589_885_845_1,
    0.148_678_267_329_357_96,
];

/// Exponential e^x.
///
/// At most 1 unit in the last place off; 0 below -708.396 where the result would be subnormal, infinite
/// above 709.78.
#[inline(always)]
pub fn exp<R: Real>(x: R) -> R {
    let k = (x * R::splat(LOG2_E)).round_ties_even();
    let high = k.mul_add(R::splat(-LN_2), x);
    let low = k * R::splat(-LN_2_TAIL);
    within_range(x, exp_reduced(k, high, low))
}

/// Natural logarithm ln x.
///
/// At most 1 unit in the last place off; -infinity for zero and for subnormal numbers, NaN for negative ones.
#[inline(always)]
pub fn ln<R: Real>(x: R) -> R {
    let Logarithm { high, low, e, .. } = logarithm(x);
    of_any_base(x, high + e.mul_add(R::splat(LN_2_TAIL), low), R::splat(f64::NEG_INFINITY))
}

/// An exponent n >= 1 of [`powf`], one for each lane, and what can be said of it before any base is known.
#[derive(Clone, Copy)]
pub struct Exponent<R: Real> {
    n: R,
    /// n log2(e), which turns a natural logarithm into the binary exponent of the power.
    n_log2_e: R,
    /// Whether n is exactly 1, 2 or 3.
    whole: R::Mask,
    all_whole: bool,
    any_whole: bool,
}

impl<R: Real> Exponent<R> {
    /// Examines n.
    #[inline(always)]
    pub fn of(n: R) -> Self {
        let near = (n - R::splat(2.0)).abs().less(R::splat(1.5));
        let whole = R::select(near, n.round_ties_even(), R::splat(f64::NAN)).equal(n);
        let n_log2_e = n * R::splat(LOG2_E);
        Self { n, n_log2_e, whole, all_whole: R::all(whole), any_whole: R::any(whole) }
    }
}

/// Power x^n of a magnitude x (no sign bit).
///
/// At most 1.5 units in the last place off for n <= 10 wherever the result is a normal number; 0 where it would be
/// subnormal. An exponent of exactly 1, 2 or 3 gives x, x x or (x x) x to the last bit, whatever the other lanes
/// hold; where all lanes have one of these, nothing else is computed. An infinite base and a NaN give a result that
/// is not finite. No state of a model asks for a negative base or a smaller exponent, and they are not looked for.
#[inline(always)]
pub fn powf<R: Real>(x: R, exponent: &Exponent<R>) -> R {
    let &Exponent { n, n_log2_e, whole, all_whole, any_whole } = exponent;
    if all_whole {
        return whole_power(x, n);
    }

    // n ln x = high + low, with the rounding error of n * logarithm.high in low. The tail of ln 2 is left out of
    // e ln 2 and of k ln 2: what remains of it, (n e - k) times the tail, is below 0.6 units for n = 10.
    let logarithm = logarithm(x);
    let high = n * logarithm.high;
    let k = (logarithm.estimate * n_log2_e).round_ties_even();
    let error = n.mul_add(logarithm.high, -high);
    let remainder = k.mul_add(R::splat(-LN_2), high);
    let low = n.mul_add(logarithm.low, error);
    // The bits of 0 and of infinity read as 2^-1023 and 2^1024, whose powers fall out of range by themselves.
    let general = within_range(high + low, exp_reduced(k, remainder, low));

    if any_whole { R::select(whole, whole_power(x, n), general) } else { general }
}

/// x^n for n = 1, 2 or 3, as products.
#[inline(always)]
fn whole_power<R: Real>(x: R, n: R) -> R {
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
    let one = R::splat(1.0);
    let half = R::splat(0.5);
    let saturated = R::splat(20.0);
    let size = x.abs();
    let size = R::select(saturated.less(size), saturated, size);
    let doubled = size + size;

    // 2 h = 2^k (e^r - 1) + (2^k - 1) keeps its relative accuracy down to the smallest x, where k = 0.
    // For k = 1 the subtraction cancels; so 2^k r + (2^k - 1), which is exact there, is formed first.
    let k = (doubled * R::splat(LOG2_E)).round_ties_even();
    let r = k.mul_add(R::splat(-LN_2), doubled);
    let tail = k * R::splat(-LN_2_TAIL);
    let scale = half.times_two_to(k);
    let linear = scale.mul_add(r, scale - half);
    let h = scale.mul_add(above_linear(r, tail), linear);

    // h/(1 + h) = h - h^2/(1 + h) = 1 - 1/(1 + h): the quotient is the smaller term, and so is its error.
    let small = h.less(R::splat(0.75));
    let larger = R::select(small, h, one);
    let smaller = R::select(small, h * h, one) / (one + h);
    (larger - smaller).copysign(x)
}

/// ln x as an unevaluated sum, less e times the tail of ln 2, and a first estimate of it.
struct Logarithm<R> {
    /// The binary exponent.
    e: R,
    high: R,
    /// Not small against the last place of `high`: up to 0.0034.
    low: R,
    /// Off by less than 1e-4, and known long before `low`.
    estimate: R,
}

/// For a positive normal x = 2^e m with 1/sqrt(2) <= m < sqrt(2): ln x = e ln 2 + 2 artanh((m - 1)/(m + 1)).
#[inline(always)]
fn logarithm<R: Real>(x: R) -> Logarithm<R> {
    let one = R::splat(1.0);
    let (e, m) = x.exponent_and_mantissa();

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
    let cube = s * z;
    Logarithm { e, high, low: cube.mul_add(series, low), estimate: cube.mul_add(R::splat(c0), high) }
}

/// 2^k e^(high + low), with |high + low| <= ln(2)/2 but for rounding.
#[inline(always)]
fn exp_reduced<R: Real>(k: R, high: R, low: R) -> R {
    let r = high + low;
    let tail = low - (r - high);
    (R::splat(1.0) + (r + above_linear(r, tail))).times_two_to(k)
}

/// e^r - 1 - r + tail.
#[inline(always)]
fn above_linear<R: Real>(r: R, tail: R) -> R {
    // Two halves of equal depth: the extra product r^6 costs less than a longer chain would.
    let [c0, c1, c2, c3, c4, c5, c6, c7, c8, c9] = EXPONENTIAL;
    let r_2 = r * r;
    let r_4 = r_2 * r_2;
    let middle = r_2.mul_add(line(r, c6, c7), line(r, c4, c5));
    let upper = r_4.mul_add(line(r, c8, c9), middle);
    let lower = r_2.mul_add(line(r, c2, c3), line(r, c0, c1));
    (r_2 * r_4).mul_add(upper, r_2.mul_add(lower, tail))
}

/// constant + slope x.
#[inline(always)]
fn line<R: Real>(x: R, constant: f64, slope: f64) -> R {
    x.mul_add(R::splat(slope), R::splat(constant))
}

/// `result`, which is e^`exponent`, where that is a normal number; else 0, infinity or NaN.
#[inline(always)]
fn within_range<R: Real>(exponent: R, result: R) -> R {
    let too_small = exponent.less(R::splat(SMALLEST_EXPONENT));
    let result = R::select(too_small, R::splat(0.0), result);
    let finite = exponent.less(R::splat(LARGEST_EXPONENT));
    R::select(finite, result, exponent + R::splat(f64::INFINITY))
}

/// `normal` where the base `x` is a positive normal number; `at_zero` below, infinity at infinity, NaN for a NaN
/// and for a negative base.
#[inline(always)]
fn of_any_base<R: Real>(x: R, normal: R, at_zero: R) -> R {
    let value = R::select(x.less(R::splat(f64::INFINITY)), normal, x);
    let value = R::select(x.less(R::splat(f64::MIN_POSITIVE)), at_zero, value);
    R::select(x.less(R::splat(0.0)), R::splat(f64::NAN), value)
}
