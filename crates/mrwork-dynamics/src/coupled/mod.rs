//! A building and its devices as one system in lanes, by classical Runge-Kutta: what the loop simulates, and what a
//! controller that predicts the motion simulates as its model of it.

mod devices;
mod elements;
mod energies;
mod groups;
mod plant;
mod slopes;
mod stages;

pub use devices::Mounting;
pub(crate) use devices::{DeviceState, Devices};
pub(crate) use elements::UNLOADING;
pub(crate) use energies::Energies;
pub use groups::Group;
pub(crate) use groups::{added_rates, devices_at_rest, mountings, n_devices, relaxation_bound};
pub(crate) use plant::{Plant, PlantMotion};
pub(crate) use stages::{END, stages};

use crate::lanes::Lanes;

/// Building and devices during the stages of a step.
pub(crate) struct Coupled<'a, R: Lanes> {
    pub(crate) plant: Plant<'a, R>,
    pub(crate) devices: Box<dyn Devices<R> + 'a>,
}

impl<R: Lanes> Coupled<'_, R> {
    /// Evaluates forces and accelerations at the start of a step, under this ground acceleration.
    pub(crate) fn evaluate(&mut self, ground: &R) {
        let Self { plant, devices } = self;
        devices.evaluate(&plant.elongation, &plant.rate, END);
        plant.accelerate(devices.force(), ground);
    }

    /// A step, from the start at which forces and accelerations were evaluated; the ground acceleration is given in its
    /// middle and at its end. Energies are integrated with the stages of the motion.
    pub(crate) fn advance(&mut self, middle: &R, end: &R, mut energies: Option<&mut Energies<R>>) {
        let Self { plant, devices } = self;
        devices.advance_drivers();
        plant.advance(devices.force(), energies.as_deref_mut());
        for (number, stage) in stages(plant.step()).into_iter().enumerate() {
            devices.advance(stage.weight, stage.reach);
            devices.evaluate(&plant.elongation, &plant.rate, stage.moment);
            let ground = if stage.moment == END { end } else { middle };
            plant.pass(number + 1, devices.force(), ground, energies.as_deref_mut());
        }
        devices.advance(plant.step() / 6.0, 0.0);
    }
}
