//! A building and its devices as one system in lanes, by classical Runge-Kutta: what the loop simulates, and what a
//! controller that predicts the motion simulates as its model of it.

mod devices;
mod elements;
mod plant;
mod slopes;

pub use devices::Mounting;
pub(crate) use devices::{DamperDevices, DeviceState, Devices};
pub(crate) use elements::UNLOADING;
pub(crate) use plant::{Energies, Plant, PlantMotion};
pub(crate) use slopes::steepest_slopes;

use crate::lanes::Lanes;

/// Times within a step at which parameters of the dampers are stored.
const MIDDLE: usize = 0;
pub(crate) const END: usize = 1;

/// How the stage before is left: its weight in the sums over the step, how far after the start of the step the next one
/// is [s], and the parameters that are in force there.
pub(crate) struct Stage {
    pub(crate) weight: f64,
    pub(crate) reach: f64,
    pub(crate) moment: usize,
}

/// The stages of a step after its start.
pub(crate) fn stages(step: f64) -> [Stage; 3] {
    let (half, sixth, third) = (0.5 * step, step / 6.0, step / 3.0);
    [
        Stage { weight: sixth, reach: half, moment: MIDDLE },
        Stage { weight: third, reach: half, moment: MIDDLE },
        Stage { weight: third, reach: step, moment: END },
    ]
}

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
