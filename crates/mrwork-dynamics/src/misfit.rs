//! What is kept of a simulated force: a running reduction, or the whole history on request.

use crate::lanes::Lanes;

/// Takes the forces of a block as they come.
pub(crate) trait Keeper<R> {
    /// Takes the force [N] of every lane at `sample`.
    fn take(&mut self, sample: usize, force: R);
    /// Whether nothing that could still come would matter, so that the rest can be skipped.
    fn is_lost(&self) -> bool;
}

/// What candidates are compared with.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Measured force [N], one sample per time.
    pub force: &'a [f64],
    /// First sample that counts; those before it are simulated only.
    pub first: usize,
}

/// What is to be kept.
pub(crate) struct Keep<'a, 'b> {
    /// The sum of squared residuals against this, in sample order.
    pub(crate) target: Option<Target<'a>>,
    /// The force itself, one row per lane; lanes beyond the rows are dropped.
    pub(crate) rows: &'a mut [&'b mut [f64]],
}

/// What has been kept so far.
pub(crate) struct Kept<'a, 'b, R> {
    pub(crate) keep: Keep<'a, 'b>,
    /// Sum of squared residuals [N^2].
    pub(crate) sum: R,
    /// Where a sum need not grow further [N^2].
    pub(crate) limit: R,
}

impl<R: Lanes> Keeper<R> for Kept<'_, '_, R> {
    #[inline(always)]
    fn take(&mut self, sample: usize, force: R) {
        if let Some(Target { force: measured, first }) = self.keep.target
            && sample >= first
        {
            let residual = force - R::splat(measured[sample]);
            self.sum = residual.mul_add(residual, self.sum);
        }
        if !self.keep.rows.is_empty() {
            force.for_each(|lane, value| {
                if let Some(row) = self.keep.rows.get_mut(lane) {
                    row[sample] = value;
                }
            });
        }
    }

    /// Whether every lane has reached its limit, or left the finite numbers.
    #[inline(always)]
    fn is_lost(&self) -> bool {
        self.keep.target.is_some() && !R::any(self.sum.less(self.limit))
    }
}
