//! What is kept of a simulated force: a running reduction, or the whole history on request.

use crate::lanes::Lanes;

/// Receives the force of every lane, sample after sample.
pub(crate) trait Sink<R: Lanes> {
    /// The force [N] at `sample`.
    fn take(&mut self, sample: usize, force: R);
    /// Whether every lane has left the finite numbers, so that the rest of the record can be skipped.
    fn is_lost(&self) -> bool;
}

/// Sum of squared residuals against a measured force [N^2] from sample `first` on, in sample order.
pub(crate) struct SquaredError<'a, R> {
    pub(crate) measured: &'a [f64],
    pub(crate) first: usize,
    pub(crate) sum: R,
}

impl<R: Lanes> Sink<R> for SquaredError<'_, R> {
    #[inline(always)]
    fn take(&mut self, sample: usize, force: R) {
        if sample >= self.first {
            let residual = force - R::splat(self.measured[sample]);
            self.sum = residual.mul_add(residual, self.sum);
        }
    }
    #[inline(always)]
    fn is_lost(&self) -> bool {
        !R::any(self.sum.less(R::splat(f64::INFINITY)))
    }
}

/// The force itself, one row per lane; lanes beyond the rows are dropped.
pub(crate) struct History<'a, 'b> {
    pub(crate) rows: &'a mut [&'b mut [f64]],
}

impl<R: Lanes> Sink<R> for History<'_, '_> {
    #[inline(always)]
    fn take(&mut self, sample: usize, force: R) {
        force.for_each(|lane, value| {
            if let Some(row) = self.rows.get_mut(lane) {
                row[sample] = value;
            }
        });
    }
    #[inline(always)]
    fn is_lost(&self) -> bool {
        false
    }
}
