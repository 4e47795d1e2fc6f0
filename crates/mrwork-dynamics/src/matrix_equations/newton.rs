//! Newton's iteration on a Riccati equation, in coordinates in which the previous solution is the identity.

use crate::lanes::Lanes;
use crate::threads::StopRequested;

use super::dense::{
    add, add_to_diagonal, norm, product, replace_where, subtract, symmetric_product, transpose,
    transposed_product,
};
use super::doubling::{Buffers, Loop, lyapunov};
use super::elimination::{cholesky, floored_cholesky, solve_lower, solve_upper, upper_inverse};
use super::equations::Time;

const MOST_STEPS: usize = 40;
/// A correction of this share of P needs no further step.
const NEGLIGIBLE: f64 = 1e-12;
/// Below this the iteration converges quadratically, and a residual that does not halve is rounding.
const QUADRATIC: f64 = 1e-6;
/// Relative tolerance of a correction.
const OF_CORRECTION: f64 = 1e-9;

/// An equation with a control weight of one: `A'P + P A - (P B + N)(B'P + N') + Q = 0`, or
/// `A'P A - P - (A'P B + N)(1 + B'P B)^-1 (B'P A + N') + Q = 0`.
pub(super) struct Problem<R> {
    pub(super) a: Vec<R>,
    pub(super) b: Vec<R>,
    pub(super) q: Vec<R>,
    pub(super) n: Vec<R>,
    pub(super) size: usize,
    pub(super) controls: usize,
    pub(super) time: Time,
    /// Of Cayley's transform in continuous time.
    pub(super) shift: R,
}

/// The best solution of each lane so far.
pub(super) struct Best<R> {
    /// P.
    pub(super) p: Vec<R>,
    /// K of `f = -K s`.
    pub(super) gain: Vec<R>,
    /// Relative residual; infinite as long as no closed loop was stable.
    pub(super) residual: R,
}

/// Matrices in the coordinates of one step.
pub(super) struct Coordinates<R> {
    /// U of `P = U'U`; the coordinates are `w = U s`.
    upper: Vec<R>,
    inverse: Vec<R>,
    a: Vec<R>,
    b: Vec<R>,
    q: Vec<R>,
    n: Vec<R>,
    p: Vec<R>,
    gain: Vec<R>,
    /// `P A`.
    moved: Vec<R>,
    residual: Vec<R>,
    /// Y of the quadratic term Y'Y, shape (controls, size).
    root: Vec<R>,
    /// `1 + B'P B` of discrete time.
    innovation: Vec<R>,
    first: Vec<R>,
    /// Of shape (size, controls) or (controls, size).
    narrow: Vec<R>,
}

impl<R: Lanes> Coordinates<R> {
    pub(super) fn new(size: usize, controls: usize) -> Self {
        let zeros = |count: usize| vec![R::splat(0.0); count];
        let (square, narrow) = (size * size, size * controls);
        Self {
            upper: zeros(square),
            inverse: zeros(square),
            a: zeros(square),
            b: zeros(narrow),
            q: zeros(square),
            n: zeros(narrow),
            p: zeros(square),
            gain: zeros(narrow),
            moved: zeros(square),
            residual: zeros(square),
            root: zeros(narrow),
            innovation: zeros(controls * controls),
            first: zeros(square),
            narrow: zeros(narrow),
        }
    }
}

/// Refines the P of every lane whose `active` is 1, and keeps the best in `best`.
///
/// The correction D of `A_c'D + D A_c = -residual`, with the closed loop `A_c = A - B K`, is Newton's step, which from any
/// P with a stable closed loop converges to the stabilising solution (Kleinman, IEEE Trans. Automatic Control 13(1), 1968,
/// 114-115). Each step is taken in coordinates in which P is the identity: with a small control weight P spans many
/// orders of magnitude, and so the small ones are resolved too.
#[inline(always)]
pub(super) fn refine<R: Lanes>(
    problem: &Problem<R>,
    mut active: R,
    p: &mut [R],
    best: &mut Best<R>,
    coordinates: &mut Coordinates<R>,
    buffers: &mut Buffers<R>,
    stop: &StopRequested<'_>,
) {
    let size = problem.size;
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    for _ in 0..MOST_STEPS {
        transform(problem, p, coordinates);
        let relative = close(problem, coordinates);
        let Coordinates { upper, a, p: scaled, gain, residual, moved, first, narrow, .. } = coordinates;
        // `a` is now the closed loop and `residual` becomes the correction.
        let closed = Loop { a, time: problem.time, shift: problem.shift, size };
        let stable = lyapunov(&closed, OF_CORRECTION, residual, buffers, stop);
        let counts = zero.less(active * stable);

        // Back to the given coordinates: P = U'P_w U, K = K_w U.
        let better = R::select(counts, relative, R::splat(f64::INFINITY)).less(best.residual);
        let halved = R::select(counts, R::select((relative + relative).less(best.residual), one, zero), zero);
        if R::any(better) {
            product(first, scaled, upper, (size, size, size));
            symmetric_product(moved, upper, first, (size, size));
            replace_where(better, &mut best.p, moved);
            product(narrow, gain, upper, (problem.controls, size, size));
            replace_where(better, &mut best.gain, narrow);
            best.residual = R::select(better, relative, best.residual);
        }
        // Another step where the loop is stable, the correction counts and the residual falls or is still large.
        let large = R::select(R::splat(QUADRATIC).less(best.residual), one, halved);
        let negligible = R::splat(NEGLIGIBLE) * norm(scaled);
        let inexact = R::select(negligible.less(norm(residual)), large, zero);
        active = R::select(counts, inexact, zero);
        let running = zero.less(active);
        if !R::any(running) || stop() {
            return;
        }
        add(scaled, residual);
        product(first, scaled, upper, (size, size, size));
        symmetric_product(moved, upper, first, (size, size));
        replace_where(running, p, moved);
    }
}

/// The problem in coordinates in which P is the identity, but for directions in which it is singular.
#[inline(always)]
fn transform<R: Lanes>(problem: &Problem<R>, p: &[R], coordinates: &mut Coordinates<R>) {
    let Coordinates { upper, inverse, a, b, q, n, p: scaled, first, .. } = coordinates;
    let (size, controls) = (problem.size, problem.controls);
    let cubic = (size, size, size);
    upper.copy_from_slice(p);
    floored_cholesky(upper, size);
    upper_inverse(inverse, upper, size);
    product(first, upper, &problem.a, cubic);
    product(a, first, inverse, cubic);
    product(b, upper, &problem.b, (size, size, controls));
    product(first, &problem.q, inverse, cubic);
    symmetric_product(q, inverse, first, (size, size));
    transposed_product(n, inverse, &problem.n, (size, size, controls));
    product(first, p, inverse, cubic);
    symmetric_product(scaled, inverse, first, (size, size));
}

/// The residual and its size relative to its terms, and the gain; A becomes the closed loop.
#[inline(always)]
fn close<R: Lanes>(problem: &Problem<R>, coordinates: &mut Coordinates<R>) -> R {
    let Coordinates { a, b, q, n, p, gain, moved, residual, root, innovation, first, narrow, .. } =
        coordinates;
    let (size, controls) = (problem.size, problem.controls);
    let one = R::splat(1.0);
    product(moved, p, a, (size, size, size));
    transpose(narrow, n, size, controls);
    let of_motion = match problem.time {
        Time::Continuous => {
            transposed_product(root, b, p, (controls, size, size));
            add(root, narrow);
            gain.copy_from_slice(root);
            transpose(residual, moved, size, size);
            add(residual, moved);
            let one_side = norm(moved);
            one_side + one_side
        }
        Time::Discrete => {
            transposed_product(root, b, moved, (controls, size, size));
            add(root, narrow);
            product(narrow, p, b, (size, size, controls));
            transposed_product(innovation, b, narrow, (controls, size, controls));
            add_to_diagonal(innovation, controls, one);
            cholesky(innovation, controls);
            solve_lower(innovation, root, controls, size);
            gain.copy_from_slice(root);
            solve_upper(innovation, gain, controls, size);
            symmetric_product(residual, a, moved, (size, size));
            let one_side = norm(residual);
            subtract(residual, p);
            one_side + norm(p)
        }
    };
    symmetric_product(first, root, root, (controls, size));
    subtract(residual, first);
    add(residual, q);
    let relative = norm(residual) / (of_motion + norm(first) + norm(q));
    product(first, b, gain, (size, controls, size));
    subtract(a, first);
    relative
}
