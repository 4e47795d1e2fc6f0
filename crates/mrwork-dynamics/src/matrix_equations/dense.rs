//! Dense row-major matrices of lanes: one matrix for each lane, side by side.
//!
//! Whatever takes cubic time is an out-of-line call, compiled once for each instruction set. Sums run in the order of the
//! inner index, one fused operation after the other, whatever the tile, so a lane gives the bits of the scalar.

#![allow(clippy::needless_range_loop)] // indices as in the equations, several arrays each

use crate::lanes::Lanes;
use crate::real::{OutOfLine, Real};

/// Rows, inner length and columns of a product.
pub(super) type Sizes = (usize, usize, usize);

/// `out = left right`.
#[inline(always)]
pub(super) fn product<R: Lanes>(out: &mut [R], left: &[R], right: &[R], sizes: Sizes) {
    R::out_of_line(Product::<R, false, false> { out, left, right, sizes });
}

/// `out = left' right`, `left` of shape (inner, rows).
#[inline(always)]
pub(super) fn transposed_product<R: Lanes>(out: &mut [R], left: &[R], right: &[R], sizes: Sizes) {
    R::out_of_line(Product::<R, true, false> { out, left, right, sizes });
}

/// `out = left' right` where that is symmetric, both of shape (inner, size): the upper half, mirrored.
#[inline(always)]
pub(super) fn symmetric_product<R: Lanes>(
    out: &mut [R],
    left: &[R],
    right: &[R],
    (inner, size): (usize, usize),
) {
    R::out_of_line(Product::<R, true, true> { out, left, right, sizes: (size, inner, size) });
}

struct Product<'a, R, const TRANSPOSED: bool, const SYMMETRIC: bool> {
    out: &'a mut [R],
    left: &'a [R],
    right: &'a [R],
    sizes: Sizes,
}

impl<R: Real, const TRANSPOSED: bool, const SYMMETRIC: bool> OutOfLine
    for Product<'_, R, TRANSPOSED, SYMMETRIC>
{
    type Home = Self;
    #[inline(always)]
    fn run(mut self) {
        let (rows, _, columns) = self.sizes;
        let mut i = 0;
        while i + 4 <= rows {
            self.row_of_tiles::<4>(i);
            i += 4;
        }
        if i + 2 <= rows {
            self.row_of_tiles::<2>(i);
            i += 2;
        }
        if i < rows {
            self.row_of_tiles::<1>(i);
        }
        if SYMMETRIC {
            for i in 1..rows {
                for j in 0..i {
                    self.out[i * columns + j] = self.out[j * columns + i];
                }
            }
        }
    }
}

impl<R: Real, const TRANSPOSED: bool, const SYMMETRIC: bool> Product<'_, R, TRANSPOSED, SYMMETRIC> {
    #[inline(always)]
    fn row_of_tiles<const I: usize>(&mut self, i: usize) {
        let columns = self.sizes.2;
        let mut j = if SYMMETRIC { i } else { 0 };
        while j + 4 <= columns {
            self.tile::<I, 4>(i, j);
            j += 4;
        }
        if j + 2 <= columns {
            self.tile::<I, 2>(i, j);
            j += 2;
        }
        if j < columns {
            self.tile::<I, 1>(i, j);
        }
    }

    #[inline(always)]
    fn tile<const I: usize, const J: usize>(&mut self, first: usize, column: usize) {
        let (rows, inner, columns) = self.sizes;
        let mut sums = [[R::splat(0.0); J]; I];
        for k in 0..inner {
            let right = &self.right[k * columns + column..][..J];
            let left = if TRANSPOSED { &self.left[k * rows + first..][..I] } else { &[] };
            for i in 0..I {
                let factor = if TRANSPOSED { left[i] } else { self.left[(first + i) * inner + k] };
                for j in 0..J {
                    sums[i][j] = factor.mul_add(right[j], sums[i][j]);
                }
            }
        }
        for i in 0..I {
            let out = &mut self.out[(first + i) * columns + column..][..J];
            // A copy of a slice is a call of its own.
            #[allow(clippy::manual_memcpy)]
            for j in 0..J {
                out[j] = sums[i][j];
            }
        }
    }
}

/// `out = matrix'`, of a matrix of shape (rows, columns).
#[inline(always)]
pub(super) fn transpose<R: Real>(out: &mut [R], matrix: &[R], rows: usize, columns: usize) {
    for i in 0..rows {
        for j in 0..columns {
            out[j * rows + i] = matrix[i * columns + j];
        }
    }
}

/// The symmetric part of a square matrix, in place.
#[inline(always)]
pub(super) fn symmetrise<R: Real>(matrix: &mut [R], size: usize) {
    let half = R::splat(0.5);
    for i in 1..size {
        for j in 0..i {
            let mean = half * (matrix[i * size + j] + matrix[j * size + i]);
            matrix[i * size + j] = mean;
            matrix[j * size + i] = mean;
        }
    }
}

/// Adds `value` to the diagonal of a square matrix.
#[inline(always)]
pub(super) fn add_to_diagonal<R: Real>(matrix: &mut [R], size: usize, value: R) {
    for i in 0..size {
        matrix[i * size + i] = matrix[i * size + i] + value;
    }
}

/// The identity.
#[inline(always)]
pub(super) fn identity<R: Real>(matrix: &mut [R], size: usize) {
    matrix.fill(R::splat(0.0));
    add_to_diagonal(matrix, size, R::splat(1.0));
}

/// Sum of the squares of all entries.
#[inline(always)]
pub(super) fn square<R: Real>(matrix: &[R]) -> R {
    let mut sum = R::splat(0.0);
    for &entry in matrix {
        sum = entry.mul_add(entry, sum);
    }
    sum
}

/// Frobenius norm.
#[inline(always)]
pub(super) fn norm<R: Real>(matrix: &[R]) -> R {
    square(matrix).sqrt()
}

/// `matrix += other`.
#[inline(always)]
pub(super) fn add<R: Real>(matrix: &mut [R], other: &[R]) {
    let other = &other[..matrix.len()];
    for i in 0..matrix.len() {
        matrix[i] = matrix[i] + other[i];
    }
}

/// `matrix -= other`.
#[inline(always)]
pub(super) fn subtract<R: Real>(matrix: &mut [R], other: &[R]) {
    let other = &other[..matrix.len()];
    for i in 0..matrix.len() {
        matrix[i] = matrix[i] - other[i];
    }
}

/// `matrix *= factor`.
#[inline(always)]
pub(super) fn scale<R: Real>(matrix: &mut [R], factor: R) {
    for entry in matrix {
        *entry = *entry * factor;
    }
}

/// Lanes of `other` where the mask holds.
#[inline(always)]
pub(super) fn replace_where<R: Real>(mask: R::Mask, matrix: &mut [R], other: &[R]) {
    let other = &other[..matrix.len()];
    for i in 0..matrix.len() {
        matrix[i] = R::select(mask, other[i], matrix[i]);
    }
}
