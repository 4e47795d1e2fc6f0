//! What a rollout knows of storeys that yield: the states of their loops from sample to sample, and what measured
//! accelerations of the floors say beyond its model.

use super::prediction::Prediction;
use crate::building::Building;
use crate::lanes::Lanes;

/// Whether a rollout with this model and this table reads the accelerations of the floors.
pub(crate) fn reads_accelerations(building: &Building, table: &[f64]) -> bool {
    building.n_elements() > 0 || table.iter().take(2).any(|&number| number > 0.0)
}

/// The storeys of the model between two samples.
pub(super) struct Storeys<R> {
    /// Whether the accelerations of the floors are measured.
    pub(super) measured: bool,
    /// Whether what the model misses of them goes into the trials.
    pub(super) offsets: bool,
    /// Rate at which the yield drifts are adapted [1/s], and their least and largest factor.
    pub(super) adaptation: f64,
    limits: [R; 2],
    sample_time: f64,
    /// Loops of the elements at the last sample.
    pub(super) loops: Vec<R>,
    /// Displacements there, and how the coordinates have moved since [m].
    pub(super) displacement: Vec<R>,
    change: Vec<R>,
    /// Accelerations that the model misses [m/s2], and what each storey resists beyond it [N].
    pub(super) missed: Vec<R>,
    shears: Vec<R>,
}

impl<R: Lanes> Storeys<R> {
    /// At rest, with the table of the law, which was checked.
    pub(super) fn new(building: &Building, table: &[f64], sample_time: f64) -> Self {
        let number = |place: usize| table.get(place).copied().unwrap_or(f64::NAN);
        let zeros = |count| vec![R::splat(0.0); count];
        Self {
            measured: reads_accelerations(building, table),
            offsets: number(0) > 0.0,
            adaptation: number(1),
            limits: [number(2), number(3)].map(R::splat),
            sample_time,
            loops: zeros(building.n_elements()),
            displacement: zeros(building.n),
            change: zeros(building.n),
            missed: zeros(building.n),
            shears: zeros(building.n_storeys()),
        }
    }

    /// Follows the loops to a sample with these displacements, where they are known: of a loop the path counts, not its
    /// time. A path of estimated velocities would go astray with the noise of the accelerations.
    #[inline(always)]
    pub(super) fn follow(
        &mut self,
        prediction: &mut Prediction<'_, R>,
        displacement: &[R],
        known: R::Mask,
        first: bool,
    ) {
        if self.loops.is_empty() {
            return;
        }
        for ((change, before), &now) in self.change.iter_mut().zip(&mut self.displacement).zip(displacement) {
            let now = R::select(known, now, *before);
            *change = now - *before;
            *before = now;
        }
        if !first {
            prediction.follow(&mut self.loops, &self.change);
        }
    }

    /// Compares the accelerations that the model has just given with measured ones, for its yield drifts and, at a
    /// decision, for the trials.
    #[inline(always)]
    pub(super) fn compare(
        &mut self,
        prediction: &mut Prediction<'_, R>,
        measured: &[R],
        ground: R,
        known: R::Mask,
        decides: bool,
    ) {
        let offsets = self.offsets && decides;
        if !(offsets || self.adaptation > 0.0) {
            return;
        }
        let building = prediction.building();
        for (coordinate, missed) in self.missed.iter_mut().enumerate() {
            let pushed = R::splat(-building.influence[coordinate]);
            let relative = ground.weighted(pushed, measured[coordinate]);
            let found = relative - prediction.acceleration()[coordinate];
            *missed = R::select(known, found, R::splat(0.0));
        }
        if self.adaptation > 0.0 {
            let mut above = R::splat(0.0);
            for (storey, shear) in self.shears.iter_mut().enumerate().rev() {
                // What accelerates more resists less.
                above = above - building.shears.mass.dot(storey, &self.missed);
                *shear = above;
            }
            let share = (self.adaptation * self.sample_time).min(1.0);
            prediction.adapt(&self.shears, share, self.limits);
        }
        if offsets {
            prediction.offset(&self.missed);
        }
    }
}
