//! Dual numbers: a value and its derivatives along a few directions, carried along by the chain rule.
//!
//! The value takes the operations that a plain number takes, in the same order, so its bits are those of a plain
//! simulation. The derivatives are exact up to rounding: those of the equations as they are computed, sub-steps and
//! all. Where an operation has a kink, they are those of the side that the value takes.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::elementary::{Elementary, Exponent, exp, ln, power_and_logarithm, tanh, whole_power};
use crate::lanes::Lanes;
use crate::real::{Bits, OutOfLine, Real};

/// A value and its derivatives along `K` directions.
#[derive(Clone, Copy)]
pub struct Dual<R, const K: usize> {
    /// The value.
    pub value: R,
    /// Its derivatives.
    pub tangents: [R; K],
}

/// Applies an expression to every direction `$k`; a loop for the reason given in `lanes.rs`.
macro_rules! each_tangent {
    ($k:ident => $tangent:expr, from $start:expr) => {{
        let mut tangents = $start;
        let mut $k = 0;
        while $k < K {
            tangents[$k] = $tangent;
            $k += 1;
        }
        tangents
    }};
}

impl<R: Real, const K: usize> Dual<R, K> {
    /// A value that depends on nothing.
    #[inline(always)]
    pub fn constant(value: R) -> Self {
        Self { value, tangents: [R::splat(0.0); K] }
    }

    /// A function of this number with that value and that slope.
    #[inline(always)]
    fn chain(self, value: R, slope: R) -> Self {
        Self { value, tangents: each_tangent!(k => slope * self.tangents[k], from self.tangents) }
    }
}

impl<R: Bits, const K: usize> Add for Dual<R, K> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let tangents = each_tangent!(k => self.tangents[k] + other.tangents[k], from self.tangents);
        Self { value: self.value + other.value, tangents }
    }
}

impl<R: Bits, const K: usize> Sub for Dual<R, K> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let tangents = each_tangent!(k => self.tangents[k] - other.tangents[k], from self.tangents);
        Self { value: self.value - other.value, tangents }
    }
}

impl<R: Bits, const K: usize> Mul for Dual<R, K> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.value, other.value);
        let tangents = each_tangent!(
            k => self.tangents[k].mul_add(b, a * other.tangents[k]), from self.tangents
        );
        Self { value: a * b, tangents }
    }
}

impl<R: Bits, const K: usize> Div for Dual<R, K> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let per_other = R::splat(1.0) / other.value;
        let tangents = each_tangent!(
            k => (-value).mul_add(other.tangents[k], self.tangents[k]) * per_other, from self.tangents
        );
        Self { value, tangents }
    }
}

impl<R: Bits, const K: usize> Neg for Dual<R, K> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, tangents: each_tangent!(k => -self.tangents[k], from self.tangents) }
    }
}

impl<R: Bits, const K: usize> Real for Dual<R, K> {
    type Mask = R::Mask;
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
    const HAS_DERIVATIVES: bool = true;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self::constant(R::splat(value))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        let (a, b) = (self.value, factor.value);
        let tangents = each_tangent!(
            k => self.tangents[k].mul_add(b, a.mul_add(factor.tangents[k], addend.tangents[k])),
            from self.tangents
        );
        Self { value: a.mul_add(b, addend.value), tangents }
    }
    #[inline(always)]
    fn weighted(self, weight: Self, addend: Self) -> Self {
        let factor = weight.value;
        let tangents =
            each_tangent!(k => self.tangents[k].mul_add(factor, addend.tangents[k]), from self.tangents);
        Self { value: self.value.mul_add(factor, addend.value), tangents }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.chain(self.value.abs(), R::splat(1.0).copysign(self.value))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        // At zero, where a running root mean square begins, the slope is infinite, and taken for zero.
        let zero = R::splat(0.0);
        self.chain(root, R::select(root.equal(zero), zero, R::splat(0.5) / root))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let own = R::splat(1.0).copysign(self.value);
        self.chain(self.value.copysign(sign.value), own.copysign(own * sign.value))
    }
    #[inline(always)]
    fn by_sign(self, positive: Self, negative: Self) -> Self {
        let sign = self.value;
        let tangents = each_tangent!(
            k => sign.by_sign(positive.tangents[k], negative.tangents[k]), from self.tangents
        );
        Self { value: sign.by_sign(positive.value, negative.value), tangents }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(self.less(other), self, other)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(other.less(self), self, other)
    }
    #[inline(always)]
    fn round_ties_even(self) -> Self {
        Self::constant(self.value.round_ties_even())
    }
    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        self.value.less(other.value)
    }
    #[inline(always)]
    fn equal(self, other: Self) -> Self::Mask {
        self.value.equal(other.value)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        let tangents =
            each_tangent!(k => R::select(mask, yes.tangents[k], no.tangents[k]), from yes.tangents);
        Self { value: R::select(mask, yes.value, no.value), tangents }
    }
    #[inline(always)]
    fn without_derivatives(self) -> Self {
        Self::constant(self.value)
    }
    #[inline(always)]
    fn out_of_line<W: OutOfLine>(work: W) {
        R::out_of_line(work);
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        R::all(mask)
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        R::any(mask)
    }
}

/// Values from outside are constants, and lanes that are read give values: derivatives come and go by their own methods.
impl<R: Lanes + Bits, const K: usize> Lanes for Dual<R, K> {
    const WIDTH: usize = R::WIDTH;
    #[inline(always)]
    fn from_fn(value: impl FnMut(usize) -> f64) -> Self {
        Self::constant(R::from_fn(value))
    }
    #[inline(always)]
    fn for_each(self, receive: impl FnMut(usize, f64)) {
        self.value.for_each(receive);
    }
    #[inline(always)]
    fn with_slopes(self, mut slope: impl FnMut(usize, usize) -> f64) -> Self {
        let tangents = each_tangent!(k => R::from_fn(|lane| slope(lane, k)), from self.tangents);
        Self { value: self.value, tangents }
    }
    #[inline(always)]
    fn for_each_slope(self, mut receive: impl FnMut(usize, usize, f64)) {
        for (k, tangent) in self.tangents.into_iter().enumerate() {
            tangent.for_each(|lane, slope| receive(lane, k, slope));
        }
    }
}

impl<R: Bits, const K: usize> Elementary for Dual<R, K> {
    #[inline(always)]
    fn exponential(self) -> Self {
        let value = exp(self.value);
        self.chain(value, value)
    }

    #[inline(always)]
    fn logarithm(self) -> Self {
        self.chain(ln(self.value), R::splat(1.0) / self.value)
    }

    /// d(x^n) = n x^(n-1) dx + x^n ln x dn; at x = 0 the slopes are 1 (for n = 1) or 0, and 0.
    #[inline(always)]
    fn power(self, exponent: &Exponent<Self>) -> Self {
        let x = self.value;
        let Dual { value: n, tangents: n_tangents } = exponent.n;
        let (general, logarithm) = power_and_logarithm(x, n);
        let value = R::select(exponent.whole, whole_power(x, n), general);
        let one = R::splat(1.0);
        let at_rest = R::select(one.less(n), R::splat(0.0), one);
        let slope = R::select(x.less(R::splat(f64::MIN_POSITIVE)), at_rest, n * value / x);
        let along_n = value * logarithm * R::splat(core::f64::consts::LN_2);
        let tangents = each_tangent!(
            k => slope.mul_add(self.tangents[k], along_n * n_tangents[k]), from self.tangents
        );
        Self { value, tangents }
    }

    #[inline(always)]
    fn hyperbolic_tangent(self) -> Self {
        let value = tanh(self.value);
        let one = R::splat(1.0);
        self.chain(value, (one - value) * (one + value))
    }
}
