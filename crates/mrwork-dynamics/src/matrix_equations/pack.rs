//! One pack of equations: from the arrays of the batch into lanes, scaled, solved, and back.

use crate::dispatch::LaneJob;
use crate::lanes::Lanes;
use crate::threads::StopRequested;

use super::dense::{identity, norm, product, subtract, symmetric_product, symmetrise, transposed_product};
use super::doubling::{Buffers, Equation, Loop, lyapunov, mean_pole, riccati};
use super::elimination::{cholesky, divide_by_upper, solve, solve_upper};
use super::equations::{Equations, LARGEST_RESIDUAL, Solution, Stack, Status, Time};
use super::newton::{Best, Coordinates, Problem, refine};

/// Sweeps that balance the rows and columns of A; it then changes by some per cent only.
const BALANCING_SWEEPS: usize = 6;
/// Relative tolerance of the cost without control.
const OF_COST: f64 = 1e-12;

/// Solves the equations of some rows of a batch, as many side by side as there are lanes.
pub(super) struct PackJob<'a, 'b> {
    pub(super) equations: &'a Equations<'a>,
    /// The first of the rows.
    pub(super) first: usize,
    /// K of each row.
    pub(super) gain: &'b mut [f64],
    /// P of each row.
    pub(super) riccati: &'b mut [f64],
    pub(super) solutions: &'b mut [Solution],
    pub(super) stop: &'a StopRequested<'a>,
}

impl LaneJob for PackJob<'_, '_> {
    type Output = ();
    type Home = Self;

    #[inline(always)]
    fn run<R: Lanes>(mut self) {
        let mut workspace = Workspace::<R>::new(self.equations);
        let mut done = 0;
        while done < self.solutions.len() && !(self.stop)() {
            workspace.load(self.equations, self.first + done);
            let best = workspace.solved(self.stop);
            self.store(&workspace, &best, done);
            done += R::WIDTH;
        }
    }
}

impl PackJob<'_, '_> {
    #[inline(always)]
    fn store<R: Lanes>(&mut self, workspace: &Workspace<R>, best: &Best<R>, done: usize) {
        let Problem { size, controls, .. } = workspace.problem;
        let (of_gain, of_riccati) = (size * controls, size * size);
        let rows = &mut self.solutions[done..];
        best.residual.for_each(|lane, residual| {
            if let Some(row) = rows.get_mut(lane) {
                row.residual = residual;
            }
        });
        workspace.sound.for_each(|lane, sound| {
            if let Some(row) = rows.get_mut(lane) {
                row.status = if sound == 0.0 {
                    Status::WeightNotPositive
                } else if row.residual <= LARGEST_RESIDUAL {
                    Status::Solved
                } else if row.residual < f64::INFINITY {
                    Status::NotConverged
                } else {
                    Status::NoStabilisingSolution
                };
            }
        });
        let count = rows.len();
        for (index, &entry) in best.gain.iter().enumerate() {
            entry.for_each(|lane, value| {
                if lane < count {
                    self.gain[(done + lane) * of_gain + index] = value;
                }
            });
        }
        for (index, &entry) in best.p.iter().enumerate() {
            entry.for_each(|lane, value| {
                if lane < count {
                    self.riccati[(done + lane) * of_riccati + index] = value;
                }
            });
        }
        for (lane, row) in rows.iter_mut().enumerate().take(R::WIDTH) {
            if row.status != Status::Solved {
                row.residual = if row.status == Status::NotConverged { row.residual } else { f64::INFINITY };
                self.gain[(done + lane) * of_gain..][..of_gain].fill(f64::INFINITY);
                self.riccati[(done + lane) * of_riccati..][..of_riccati].fill(f64::INFINITY);
            }
        }
    }
}

/// All that a pack needs, allocated once for many packs.
struct Workspace<R> {
    /// In coordinates z of s = T z, with forces in which the control weight is one.
    problem: Problem<R>,
    scaling: Vec<R>,
    unscaling: Vec<R>,
    /// U of the control weight `U'U`.
    upper: Vec<R>,
    /// 1 where the control weight is positive definite, else 0.
    sound: R,
    p: Vec<R>,
    first: Vec<R>,
    second: Vec<R>,
    third: Vec<R>,
    narrow: Vec<R>,
    coordinates: Coordinates<R>,
    buffers: Buffers<R>,
}

impl<R: Lanes> Workspace<R> {
    fn new(equations: &Equations<'_>) -> Self {
        let (size, controls) = (equations.n_states, equations.n_controls);
        let zeros = |count: usize| vec![R::splat(0.0); count];
        let (square, narrow) = (size * size, size * controls);
        Self {
            problem: Problem {
                a: zeros(square),
                b: zeros(narrow),
                q: zeros(square),
                n: zeros(narrow),
                size,
                controls,
                time: equations.time,
                shift: R::splat(1.0),
            },
            scaling: zeros(square),
            unscaling: zeros(square),
            upper: zeros(controls * controls),
            sound: R::splat(1.0),
            p: zeros(square),
            first: zeros(square),
            second: zeros(square),
            third: zeros(square),
            narrow: zeros(narrow),
            coordinates: Coordinates::new(size, controls),
            buffers: Buffers::new(size),
        }
    }

    /// Loads the equations from row `first` on, the last one again in lanes that are left over, and scales them.
    #[inline(always)]
    fn load(&mut self, equations: &Equations<'_>, first: usize) {
        let last = equations.n_batch - 1;
        load(&mut self.first, equations.state, first, last);
        load(&mut self.problem.b, equations.control, first, last);
        load(&mut self.problem.q, equations.state_weight, first, last);
        load(&mut self.upper, equations.control_weight, first, last);
        match equations.cross_weight {
            Some(cross) => load(&mut self.problem.n, cross, first, last),
            None => self.problem.n.fill(R::splat(0.0)),
        }
        match equations.scaling {
            Some(scaling) => load(&mut self.scaling, scaling, first, last),
            None => balance(&mut self.scaling, &self.first, &mut self.second, self.problem.size),
        }
        self.scale_state();
        self.scale_control();
    }

    /// `A = T^-1 A T, B = T^-1 B, Q = T'Q T, N = T'N`; the unscaled A is in `first`.
    #[inline(always)]
    fn scale_state(&mut self) {
        let Self { problem, scaling, unscaling, first, second, narrow, .. } = self;
        let Problem { a, b, q, n, size, controls, .. } = problem;
        let (size, controls) = (*size, *controls);
        let cubic = (size, size, size);
        second.copy_from_slice(scaling);
        identity(unscaling, size);
        solve(second, unscaling, size, size);
        product(second, first, scaling, cubic);
        product(a, unscaling, second, cubic);
        product(narrow, unscaling, b, (size, size, controls));
        b.copy_from_slice(narrow);
        symmetrise(q, size);
        product(second, q, scaling, cubic);
        symmetric_product(q, scaling, second, (size, size));
        transposed_product(narrow, scaling, n, (size, size, controls));
        n.copy_from_slice(narrow);
    }

    /// Forces g = U f with `R = U'U`, so that their weight is one: `B = B U^-1, N = N U^-1`.
    #[inline(always)]
    fn scale_control(&mut self) {
        let controls = self.problem.controls;
        self.sound = R::splat(1.0);
        if controls == 0 {
            return;
        }
        symmetrise(&mut self.upper, controls);
        cholesky(&mut self.upper, controls);
        let zero = R::splat(0.0);
        for i in 0..controls {
            self.sound = R::select(zero.less(self.upper[i * controls + i]), self.sound, zero);
        }
        divide_by_upper(&mut self.problem.b, &self.upper, controls);
        divide_by_upper(&mut self.problem.n, &self.upper, controls);
    }

    /// The solution of each lane, in the given coordinates.
    #[inline(always)]
    fn solved(&mut self, stop: &StopRequested<'_>) -> Best<R> {
        let Self { problem, p, first, second, third, narrow, coordinates, buffers, .. } = self;
        let (size, controls) = (problem.size, problem.controls);
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        // A - B N' in `first`, G = B B' in `second`, H = Q - N N' in `third`.
        outer_product(second, &problem.b, &problem.n, narrow, size, controls);
        first.copy_from_slice(&problem.a);
        subtract(first, second);
        outer_product(p, &problem.n, &problem.n, narrow, size, controls);
        third.copy_from_slice(&problem.q);
        subtract(third, p);
        outer_product(second, &problem.b, &problem.b, narrow, size, controls);
        let equation = Equation { a: first, g: second, h: third, size };
        problem.shift = one;
        if problem.time == Time::Continuous {
            let shift = mean_pole(&equation, buffers);
            // A pole of zero has no logarithm; any shift then shows that it is not stabilised.
            let size = norm(&problem.a) + norm(second) + norm(third);
            let least = R::splat(1e-12) * size + R::splat(f64::MIN_POSITIVE);
            problem.shift = R::select(least.less(shift), shift, least);
        }
        let mut best = Best {
            p: vec![zero; size * size],
            gain: vec![zero; size * controls],
            residual: R::splat(f64::INFINITY),
        };
        if controls > 0 {
            let found = riccati(&equation, problem.time, problem.shift, p, buffers, stop);
            refine(problem, found, p, &mut best, coordinates, buffers, stop);
        }
        // Where that failed: Newton's iteration from the cost without control, if the plant is stable.
        let failed = R::select(best.residual.less(R::splat(LARGEST_RESIDUAL)), zero, self.sound);
        if R::any(zero.less(failed)) && !stop() {
            p.copy_from_slice(&problem.q);
            let open = Loop { a: &problem.a, time: problem.time, shift: problem.shift, size };
            let stable = lyapunov(&open, OF_COST, p, buffers, stop);
            refine(problem, stable * failed, p, &mut best, coordinates, buffers, stop);
        }
        self.unscale(&mut best);
        best
    }

    /// `P = T'^-1 P T^-1, K = U^-1 K T^-1`.
    #[inline(always)]
    fn unscale(&mut self, best: &mut Best<R>) {
        let Self { problem, unscaling, upper, first, narrow, .. } = self;
        let (size, controls) = (problem.size, problem.controls);
        product(first, &best.p, unscaling, (size, size, size));
        symmetric_product(&mut best.p, unscaling, first, (size, size));
        if controls > 0 {
            solve_upper(upper, &mut best.gain, controls, size);
            product(narrow, &best.gain, unscaling, (controls, size, size));
            best.gain.copy_from_slice(narrow);
        }
    }
}

/// `out = left right'`, both of shape (size, controls).
#[inline(always)]
fn outer_product<R: Lanes>(
    out: &mut [R],
    left: &[R],
    right: &[R],
    narrow: &mut [R],
    size: usize,
    controls: usize,
) {
    super::dense::transpose(narrow, right, size, controls);
    product(out, left, narrow, (size, controls, size));
}

#[inline(always)]
fn load<R: Lanes>(out: &mut [R], stack: Stack<'_>, first: usize, last: usize) {
    for (index, entry) in out.iter_mut().enumerate() {
        *entry = R::from_fn(|lane| stack.of_row((first + lane).min(last))[index]);
    }
}

/// A diagonal T with which the rows and columns of `T^-1 A T` have equal norms but for rounding (Osborne, J. ACM 7(4),
/// 1960, 338-345); `balanced` becomes that matrix.
#[inline(always)]
fn balance<R: Lanes>(scaling: &mut [R], a: &[R], balanced: &mut [R], size: usize) {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    identity(scaling, size);
    balanced.copy_from_slice(a);
    for _ in 0..BALANCING_SWEEPS {
        for i in 0..size {
            let (mut row, mut column) = (zero, zero);
            for j in 0..size {
                if j != i {
                    row = row + balanced[i * size + j].abs();
                    column = column + balanced[j * size + i].abs();
                }
            }
            let factor = (row / column).sqrt();
            let usable = R::select(factor.less(R::splat(f64::INFINITY)), factor, zero);
            let factor = R::select(zero.less(usable), factor, one);
            for j in 0..size {
                balanced[j * size + i] = balanced[j * size + i] * factor;
            }
            for j in 0..size {
                balanced[i * size + j] = balanced[i * size + j] / factor;
            }
            scaling[i * size + i] = scaling[i * size + i] * factor;
        }
    }
}
