//! Work on a building in lanes, integrated with the stages of the motion; plant and elements add to it.

use crate::building::Building;
use crate::real::Real;

/// Work on a building since its start [J].
#[derive(Clone)]
pub(crate) struct Energies<R> {
    /// Of the ground and of forces on floors.
    pub(crate) input: R,
    /// Of the damping of the building, with the dashpots of elements.
    pub(crate) damping: R,
    /// Of each device.
    pub(crate) devices: Vec<R>,
    /// On each element, but for its spring and dashpot.
    pub(crate) elements: Vec<R>,
    /// On each element with its dashpot.
    pub(crate) with_dashpots: Vec<R>,
}

impl<R: Real> Energies<R> {
    pub(crate) fn zero(building: &Building) -> Self {
        let zero = R::splat(0.0);
        Self {
            input: zero,
            damping: zero,
            devices: vec![zero; building.n_devices()],
            elements: vec![zero; building.n_elements()],
            with_dashpots: vec![zero; building.n_elements()],
        }
    }

    /// Work of the damping without that of the dashpots of elements.
    #[inline(always)]
    pub(crate) fn damping_alone(&self) -> R {
        let mut alone = self.damping;
        for (&whole, &part) in self.with_dashpots.iter().zip(&self.elements) {
            alone = alone - (whole - part);
        }
        alone
    }

    /// Adds weighted powers of the ground and of the damping.
    #[inline(always)]
    pub(crate) fn add(&mut self, [input, damping]: [R; 2], weight: f64) {
        self.input = input.weighted(R::splat(weight), self.input);
        self.damping = damping.weighted(R::splat(weight), self.damping);
    }
}
