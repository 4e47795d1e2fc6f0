//! Linear systems of lanes: Gaussian elimination with pivots, Cholesky factors, triangular systems.

#![allow(clippy::needless_range_loop)] // indices as in the equations, several arrays each

use crate::elementary::ln;
use crate::lanes::Lanes;
use crate::real::{OutOfLine, Real};

/// A pivot stays where it is if no other one of its column is ten times as large: rows are seldom exchanged, which
/// costs as much as eliminating, and factors still do not exceed ten.
const PIVOT_THRESHOLD: f64 = 0.1;
/// Columns of right-hand sides that are solved for together.
const TILE: usize = 8;
/// A pivot of a Cholesky factor below this share of its diagonal entry is rounding.
const SMALLEST_SHARE: f64 = 1e-14;
/// The same, of the largest diagonal entry.
const SMALLEST_OF_ALL: f64 = 1e-28;

/// Solves `matrix x = right` in place: `right`, shape (size, columns), becomes x; `matrix` becomes its factors, with the
/// pivots on the diagonal.
///
/// A singular matrix gives numbers that are not finite.
#[inline(always)]
pub(super) fn solve<R: Lanes>(matrix: &mut [R], right: &mut [R], size: usize, columns: usize) {
    R::out_of_line(Elimination { matrix, right, size, columns });
}

/// Logarithm of the modulus of the determinant of a matrix from its factors.
#[inline(always)]
pub(super) fn ln_determinant<R: Lanes>(factors: &[R], size: usize) -> R {
    let mut sum = R::splat(0.0);
    for i in 0..size {
        sum = sum + ln(factors[i * size + i].abs());
    }
    sum
}

struct Elimination<'a, R> {
    matrix: &'a mut [R],
    right: &'a mut [R],
    size: usize,
    columns: usize,
}

impl<R: Real> OutOfLine for Elimination<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(mut self) {
        for k in 0..self.size {
            self.exchange(k);
            self.eliminate(k);
        }
        let mut column = 0;
        while column + TILE <= self.columns {
            self.substitute::<TILE>(column);
            column += TILE;
        }
        while column + 2 <= self.columns {
            self.substitute::<2>(column);
            column += 2;
        }
        if column < self.columns {
            self.substitute::<1>(column);
        }
    }
}

impl<R: Real> Elimination<'_, R> {
    /// Brings the pivot of column `k` to row `k`, in each lane its own.
    #[inline(always)]
    fn exchange(&mut self, k: usize) {
        let size = self.size;
        let present = self.matrix[k * size + k].abs();
        let (mut largest, mut row) = (present, R::splat(row_number(k)));
        for i in k + 1..size {
            let other = self.matrix[i * size + k].abs();
            let larger = largest.less(other);
            largest = R::select(larger, other, largest);
            row = R::select(larger, R::splat(row_number(i)), row);
        }
        let stays = (largest * R::splat(PIVOT_THRESHOLD)).less(present);
        row = R::select(stays, R::splat(row_number(k)), row);
        for i in k + 1..size {
            let chosen = row.equal(R::splat(row_number(i)));
            if R::any(chosen) {
                exchange_rows(self.matrix, k, i, size, chosen);
                exchange_rows(self.right, k, i, self.columns, chosen);
            }
        }
    }

    #[inline(always)]
    fn eliminate(&mut self, k: usize) {
        let size = self.size;
        let (above, below) = self.matrix.split_at_mut((k + 1) * size);
        let pivot_row = &above[k * size..];
        let inverse = R::splat(1.0) / pivot_row[k];
        for i in 0..size - k - 1 {
            let row = &mut below[i * size..][..size];
            let factor = row[k] * inverse;
            row[k] = factor;
            for j in k + 1..size {
                row[j] = (-factor).mul_add(pivot_row[j], row[j]);
            }
        }
    }

    /// Forward and back substitution of `J` columns of the right-hand side.
    #[inline(always)]
    fn substitute<const J: usize>(&mut self, column: usize) {
        let (size, columns) = (self.size, self.columns);
        for i in 0..size {
            let (known, rest) = self.right.split_at_mut(i * columns);
            let mut sums = [R::splat(0.0); J];
            let factors = &self.matrix[i * size..][..i];
            for k in 0..factors.len() {
                let row = &known[k * columns + column..][..J];
                for j in 0..J {
                    sums[j] = factors[k].mul_add(row[j], sums[j]);
                }
            }
            let own = &mut rest[column..][..J];
            for j in 0..J {
                own[j] = own[j] - sums[j];
            }
        }
        for i in (0..size).rev() {
            let (before, known) = self.right.split_at_mut((i + 1) * columns);
            let mut sums = [R::splat(0.0); J];
            let factors = &self.matrix[i * size + i + 1..][..size - i - 1];
            for k in 0..factors.len() {
                let row = &known[k * columns + column..][..J];
                for j in 0..J {
                    sums[j] = factors[k].mul_add(row[j], sums[j]);
                }
            }
            let inverse = R::splat(1.0) / self.matrix[i * size + i];
            let own = &mut before[i * columns + column..][..J];
            for j in 0..J {
                own[j] = (own[j] - sums[j]) * inverse;
            }
        }
    }
}

#[allow(clippy::cast_precision_loss)] // far below 2^53
fn row_number(row: usize) -> f64 {
    row as f64
}

/// Exchanges two rows where the mask holds.
#[inline(always)]
fn exchange_rows<R: Real>(matrix: &mut [R], first: usize, second: usize, columns: usize, mask: R::Mask) {
    let (before, after) = matrix.split_at_mut(second * columns);
    let first = &mut before[first * columns..][..columns];
    let second = &mut after[..columns];
    for j in 0..columns {
        let kept = first[j];
        first[j] = R::select(mask, second[j], kept);
        second[j] = R::select(mask, kept, second[j]);
    }
}

/// U of `matrix = U'U`, upper triangular with zeros below, in place; not a number where that is not positive definite.
#[inline(always)]
pub(super) fn cholesky<R: Lanes>(matrix: &mut [R], size: usize) {
    R::out_of_line(Cholesky::<R, false> { matrix, size });
}

/// The same for a semidefinite matrix: a pivot that is rounding is replaced by a small one, and its row by zeros.
#[inline(always)]
pub(super) fn floored_cholesky<R: Lanes>(matrix: &mut [R], size: usize) {
    R::out_of_line(Cholesky::<R, true> { matrix, size });
}

struct Cholesky<'a, R, const FLOORED: bool> {
    matrix: &'a mut [R],
    size: usize,
}

impl<R: Real, const FLOORED: bool> OutOfLine for Cholesky<'_, R, FLOORED> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { matrix, size } = self;
        let zero = R::splat(0.0);
        let mut largest = zero;
        for i in 0..size {
            let entry = matrix[i * size + i];
            largest = R::select(largest.less(entry), entry, largest);
            for j in 0..i {
                matrix[i * size + j] = zero;
            }
        }
        // Below the diagonal of the factor there is room: the diagonal entries, of which a pivot must be a share.
        for k in 0..size {
            let (above, below) = matrix.split_at_mut((k + 1) * size);
            let row = &mut above[k * size..];
            let mut pivot = row[k];
            let mut tail = R::splat(1.0);
            if FLOORED {
                let floor = R::splat(SMALLEST_OF_ALL) * largest;
                let given = if k == 0 { pivot } else { row[0] };
                let share = R::splat(SMALLEST_SHARE) * given;
                let floor = R::select(floor.less(share), share, floor);
                let sound = floor.less(pivot);
                tail = R::select(sound, tail, zero);
                pivot = R::select(sound, pivot, floor);
                if k > 0 {
                    row[0] = zero;
                }
            }
            let root = pivot.sqrt();
            row[k] = root;
            let inverse = tail / root;
            for j in k + 1..size {
                row[j] = row[j] * inverse;
            }
            for i in k + 1..size {
                let other = &mut below[(i - k - 1) * size..][..size];
                if FLOORED && k == 0 {
                    other[0] = other[i];
                }
                let factor = row[i];
                for j in i..size {
                    other[j] = (-factor).mul_add(row[j], other[j]);
                }
            }
        }
    }
}

/// `out = U^-1` of an upper triangular matrix.
#[inline(always)]
pub(super) fn upper_inverse<R: Lanes>(out: &mut [R], upper: &[R], size: usize) {
    R::out_of_line(UpperInverse { out, upper, size });
}

struct UpperInverse<'a, R> {
    out: &'a mut [R],
    upper: &'a [R],
    size: usize,
}

impl<R: Real> OutOfLine for UpperInverse<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { out, upper, size } = self;
        out.fill(R::splat(0.0));
        for i in (0..size).rev() {
            let (before, known) = out.split_at_mut((i + 1) * size);
            let own = &mut before[i * size..];
            for k in i + 1..size {
                let row = &known[(k - i - 1) * size..][..size];
                let factor = upper[i * size + k];
                for j in k..size {
                    own[j] = factor.mul_add(row[j], own[j]);
                }
            }
            let inverse = R::splat(1.0) / upper[i * size + i];
            own[i] = inverse;
            for j in i + 1..size {
                own[j] = -(own[j] * inverse);
            }
        }
    }
}

/// `rows = rows U^-1` in place, `rows` of shape (count, size).
#[inline(always)]
pub(super) fn divide_by_upper<R: Real>(rows: &mut [R], upper: &[R], size: usize) {
    for row in rows.chunks_exact_mut(size) {
        for j in 0..size {
            let mut sum = row[j];
            for i in 0..j {
                sum = (-row[i]).mul_add(upper[i * size + j], sum);
            }
            row[j] = sum / upper[j * size + j];
        }
    }
}

/// `x = U'^-1 x` in place, x of shape (size, columns).
#[inline(always)]
pub(super) fn solve_lower<R: Real>(upper: &[R], x: &mut [R], size: usize, columns: usize) {
    for i in 0..size {
        for j in 0..columns {
            let mut sum = x[i * columns + j];
            for k in 0..i {
                sum = (-upper[k * size + i]).mul_add(x[k * columns + j], sum);
            }
            x[i * columns + j] = sum / upper[i * size + i];
        }
    }
}

/// `x = U^-1 x` in place, x of shape (size, columns).
#[inline(always)]
pub(super) fn solve_upper<R: Real>(upper: &[R], x: &mut [R], size: usize, columns: usize) {
    for i in (0..size).rev() {
        for j in 0..columns {
            let mut sum = x[i * columns + j];
            for k in i + 1..size {
                sum = (-upper[i * size + k]).mul_add(x[k * columns + j], sum);
            }
            x[i * columns + j] = sum / upper[i * size + i];
        }
    }
}
