//! Doubling: each iteration squares the decay of the closed loop, by matrix products and one linear system.

use crate::elementary::exp;
use crate::lanes::Lanes;
use crate::real::Real;
use crate::threads::StopRequested;

use super::dense::{
    add, add_to_diagonal, identity, product, replace_where, scale, square, subtract, symmetric_product,
    symmetrise, transpose,
};
use super::elimination::{ln_determinant, solve};
use super::equations::Time;

/// Sixty doublings suffice for every loop that is stable in double precision.
const MOST_DOUBLINGS: usize = 60;
/// A given loop that does not contract in forty doublings decays by less than 1e-12 in a sample, which is rounding.
const MOST_DOUBLINGS_OF_A_LOOP: usize = 40;
/// Square of a norm beyond which an iteration grows without bound: a mode that is not stabilised grows quadratically.
const LARGEST_SQUARE: f64 = 1e120;
/// Doubling of a Riccati equation ends where it adds less than this share: the next step would add its square.
const SETTLED: f64 = 1e-10;
/// Below this norm the powers of a transition matrix only decay.
const CONTRACTS: f64 = 0.5;

/// `A'X + X A - X G X + H = 0`, or `X = A'X (1 + G X)^-1 A + H`, with G and H symmetric.
pub(super) struct Equation<'a, R> {
    pub(super) a: &'a [R],
    pub(super) g: &'a [R],
    pub(super) h: &'a [R],
    pub(super) size: usize,
}

/// A loop `s' = A s` or `s_{k+1} = A s_k`, with the shift of Cayley's transform in continuous time.
pub(super) struct Loop<'a, R> {
    pub(super) a: &'a [R],
    pub(super) time: Time,
    pub(super) shift: R,
    pub(super) size: usize,
}

/// Buffers of both doublings, each of one matrix unless it says otherwise.
pub(super) struct Buffers<R> {
    a: Vec<R>,
    g: Vec<R>,
    w: Vec<R>,
    /// Two matrices side by side.
    pair: Vec<R>,
    first: Vec<R>,
    second: Vec<R>,
    third: Vec<R>,
    /// A matrix of twice the size.
    wide: Vec<R>,
}

impl<R: Lanes> Buffers<R> {
    pub(super) fn new(size: usize) -> Self {
        let zeros = |count: usize| vec![R::splat(0.0); count * size * size];
        Self {
            a: zeros(1),
            g: zeros(1),
            w: zeros(1),
            pair: zeros(2),
            first: zeros(1),
            second: zeros(1),
            third: zeros(1),
            wide: zeros(4),
        }
    }
}

/// Geometric mean of the moduli of the poles of the closed loop: the best shift of Cayley's transform (Chu, Fan & Lin,
/// Linear Algebra and its Applications 396, 2005, 55-80). Half of the eigenvalues of `[A -G; -H -A']` are these poles, the
/// other half their mirror images.
#[inline(always)]
pub(super) fn mean_pole<R: Lanes>(equation: &Equation<'_, R>, buffers: &mut Buffers<R>) -> R {
    let &Equation { a, g, h, size } = equation;
    let wide = &mut buffers.wide;
    for i in 0..size {
        for j in 0..size {
            wide[2 * i * size + j] = a[i * size + j];
            wide[2 * i * size + size + j] = -g[i * size + j];
            wide[2 * (size + i) * size + j] = -h[i * size + j];
            wide[2 * (size + i) * size + size + j] = -a[j * size + i];
        }
    }
    solve(wide, &mut [], 2 * size, 0);
    #[allow(clippy::cast_precision_loss)] // far below 2^53
    let count = R::splat(2.0 * size as f64);
    exp(ln_determinant(wide, 2 * size) / count)
}

/// The stabilising X of an equation and 1 in each lane where it was found, 0 elsewhere; X replaces `x`.
///
/// In discrete time `A_+ = A W^-1 A, G_+ = G + A W^-1 G A', H_+ = H + A'H W^-1 A` with `W = 1 + G H`: H tends to X (Chu,
/// Fan, Lin & Wang, Int. J. Control 77(8), 2004, 767-788). In continuous time Cayley's transform with `shift` comes first.
#[inline(always)]
pub(super) fn riccati<R: Lanes>(
    equation: &Equation<'_, R>,
    time: Time,
    shift: R,
    x: &mut [R],
    buffers: &mut Buffers<R>,
    stop: &StopRequested<'_>,
) -> R {
    let size = equation.size;
    match time {
        Time::Discrete => {
            buffers.a.copy_from_slice(equation.a);
            buffers.g.copy_from_slice(equation.g);
            x.copy_from_slice(equation.h);
        }
        Time::Continuous => cayley(equation, shift, x, buffers),
    }
    let Buffers { a, g, w, pair, first, second, third, .. } = buffers;
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let (mut active, mut found) = (one, zero);
    for _ in 0..MOST_DOUBLINGS {
        product(w, g, x, (size, size, size));
        add_to_diagonal(w, size, one);
        for i in 0..size {
            pair[2 * i * size..][..size].copy_from_slice(&a[i * size..][..size]);
            pair[(2 * i + 1) * size..][..size].copy_from_slice(&g[i * size..][..size]);
        }
        solve(w, pair, size, 2 * size);
        for i in 0..size {
            first[i * size..][..size].copy_from_slice(&pair[2 * i * size..][..size]);
            second[i * size..][..size].copy_from_slice(&pair[(2 * i + 1) * size..][..size]);
        }
        let running = zero.less(active);
        // G: A (W^-1 G) A', with A' in `w`.
        transpose(w, a, size, size);
        product(third, second, w, (size, size, size));
        symmetric_product(second, w, third, (size, size));
        add(second, g);
        replace_where(running, g, second);
        // H: A' (H W^-1 A).
        product(third, x, first, (size, size, size));
        symmetric_product(second, a, third, (size, size));
        let added = square(second);
        add(second, x);
        replace_where(running, x, second);
        // A: A (W^-1 A).
        product(third, a, first, (size, size, size));
        replace_where(running, a, third);

        let (of_a, of_x) = (square(a), square(x));
        let settled = R::select(
            (of_x * R::splat(SETTLED * SETTLED)).less(added),
            zero,
            bounded(R::select(of_a.less(of_x), of_x, of_a)),
        );
        let growing = one - bounded(of_a) * bounded(of_x);
        let ended = R::select(zero.less(settled + growing), active, zero);
        found = R::select(zero.less(ended * settled), one, found);
        active = active - ended;
        if !R::any(zero.less(active)) || stop() {
            break;
        }
    }
    found
}

/// 1 where a square is below the largest admissible one, 0 elsewhere, and where it is not a number.
#[inline(always)]
fn bounded<R: Real>(square: R) -> R {
    R::select(square.less(R::splat(LARGEST_SQUARE)), R::splat(1.0), R::splat(0.0))
}

/// The discrete equation with the same X: A and G in their buffers, H in `h`.
#[inline(always)]
fn cayley<R: Lanes>(equation: &Equation<'_, R>, shift: R, h: &mut [R], buffers: &mut Buffers<R>) {
    let &Equation { a: given, g: of_control, h: weight, size } = equation;
    let Buffers { a, g, w, first, second, third, .. } = buffers;
    let cubic = (size, size, size);
    // E = (A - shift)^-1 in `first`.
    w.copy_from_slice(given);
    add_to_diagonal(w, size, -shift);
    identity(first, size);
    solve(w, first, size, size);
    // W = (A - shift)' + H E G, and V = W^-1 in `h`.
    product(second, first, of_control, cubic);
    product(w, weight, second, cubic);
    transpose(third, given, size, size);
    add_to_diagonal(third, size, -shift);
    add(w, third);
    identity(h, size);
    solve(w, h, size, size);
    // G: 2 shift E G V, A: 1 + 2 shift V', H: 2 shift V (H E).
    let twice = shift + shift;
    product(g, second, h, cubic);
    scale(g, twice);
    symmetrise(g, size);
    product(second, weight, first, cubic);
    product(third, h, second, cubic);
    transpose(a, h, size, size);
    scale(a, twice);
    add_to_diagonal(a, size, R::splat(1.0));
    h.copy_from_slice(third);
    scale(h, twice);
    symmetrise(h, size);
}

/// X of `A'X + X A + W = 0`, or of `X = A'X A + W`, with W in `x`, and 1 in each lane where it was found, that is, where A
/// is stable and the relative step fell to `tolerance`.
///
/// Smith's iteration `X_+ = X + S'X S, S_+ = S^2` (SIAM J. Appl. Math. 16, 1968, 198-201).
#[inline(always)]
pub(super) fn lyapunov<R: Lanes>(
    closed: &Loop<'_, R>,
    tolerance: f64,
    x: &mut [R],
    buffers: &mut Buffers<R>,
    stop: &StopRequested<'_>,
) -> R {
    let &Loop { a, time, shift, size } = closed;
    let Buffers { a: power, w, first, second, third, .. } = buffers;
    let cubic = (size, size, size);
    match time {
        Time::Discrete => power.copy_from_slice(a),
        Time::Continuous => {
            // V = (shift - A)^-1: S = 2 shift V - 1, X = 2 shift V'W V.
            w.fill(R::splat(0.0));
            add_to_diagonal(w, size, shift);
            subtract(w, a);
            identity(power, size);
            solve(w, power, size, size);
            product(first, x, power, cubic);
            symmetric_product(x, power, first, (size, size));
            scale(x, shift + shift);
            scale(power, shift + shift);
            add_to_diagonal(power, size, R::splat(-1.0));
        }
    }
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let (mut active, mut found) = (one, zero);
    let contracts = R::splat(CONTRACTS * CONTRACTS);
    for _ in 0..MOST_DOUBLINGS_OF_A_LOOP {
        let running = zero.less(active);
        product(first, x, power, cubic);
        symmetric_product(second, power, first, (size, size));
        let added = square(second);
        add(second, x);
        replace_where(running, x, second);
        product(third, power, power, cubic);
        replace_where(running, power, third);

        let (of_power, of_x) = (square(power), square(x));
        let bounded = bounded(of_power) * bounded(of_x);
        let small = R::select((of_x * R::splat(tolerance * tolerance)).less(added), zero, bounded);
        let settled = R::select(of_power.less(contracts), small, zero);
        let ended = R::select(zero.less(settled + (one - bounded)), active, zero);
        found = R::select(zero.less(ended * settled), one, found);
        active = active - ended;
        if !R::any(zero.less(active)) || stop() {
            break;
        }
    }
    found
}
