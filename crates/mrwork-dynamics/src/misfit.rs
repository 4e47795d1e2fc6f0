//! What is recorded of a simulated force: the running sum of squared residuals, or the force history on request.

use crate::damper::model::{DamperModel, Motion};
use crate::driver::Driver;
use crate::lanes::Lanes;
use crate::real::Real;

/// Receives the states of a block, sample by sample, and works out the forces.
pub(crate) trait ForceSink<M: DamperModel, R: Real, D: Driver<M, R>> {
    /// Takes the state and motion of every lane at `sample`; the parameters are those of the driver.
    fn take(&mut self, sample: usize, driver: &D, state: M::State<R>, motion: Motion<R>);
    /// Whether later samples cannot change the result, so that the simulation may stop.
    fn is_settled(&self) -> bool;
}

/// The measured force that candidates are compared with.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Measured force [N], one sample per time.
    pub force: &'a [f64],
    /// First sample of the comparison; earlier ones are simulated only.
    pub first: usize,
}

/// What a block is to return.
pub(crate) struct ForceOutput<'a, 'b> {
    /// Sum the squared residuals against this target, in sample order.
    pub(crate) target: Option<Target<'a>>,
    /// Write the force here, one row per candidate.
    pub(crate) rows: &'a mut [&'b mut [f64]],
}

/// The running result of a pack.
pub(crate) struct ForceAccumulator<'a, 'b, R> {
    pub(crate) target: Option<Target<'a>>,
    /// One row per lane; lanes without a row are dropped.
    pub(crate) rows: &'a mut [&'b mut [f64]],
    /// Sum of squared residuals [N^2].
    pub(crate) sum: R,
    /// Sum at which a lane is abandoned [N^2].
    pub(crate) limit: R,
}

impl<M: DamperModel, R: Lanes, D: Driver<M, R>> ForceSink<M, R, D> for ForceAccumulator<'_, '_, R> {
    #[inline(always)]
    fn take(&mut self, sample: usize, driver: &D, state: M::State<R>, motion: Motion<R>) {
        let force = M::force(driver.parameters(), state, motion);
        if let Some(Target { force: measured, first }) = self.target
            && sample >= first
        {
            let residual = force - R::splat(measured[sample]);
            self.sum = residual.mul_add(residual, self.sum);
        }
        if !self.rows.is_empty() {
            force.for_each(|lane, value| {
                if let Some(row) = self.rows.get_mut(lane) {
                    row[sample] = value;
                }
            });
        }
    }

    /// Whether every lane has reached its limit or is no longer finite.
    #[inline(always)]
    fn is_settled(&self) -> bool {
        self.target.is_some() && !R::any(self.sum.less(self.limit))
    }
}
