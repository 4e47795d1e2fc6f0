//! The coordinates of a building in lanes, through the stages of a step.

use super::reductions::Reductions;
use crate::building::Building;
use crate::lanes::{Apart, Lanes};

/// Motion of the coordinates.
///
/// Classical Runge-Kutta in the form for accelerations: the displacement takes h v + h^2 (a1 + a2 + a3)/6.
pub(super) struct Plant<'a, R> {
    building: &'a Building,
    pub(super) displacement: Vec<R>,
    pub(super) velocity: Vec<R>,
    staged_displacement: Vec<R>,
    staged_velocity: Vec<R>,
    next_displacement: Vec<R>,
    next_velocity: Vec<R>,
    /// Accelerations relative to the ground at this stage.
    pub(super) acceleration: Vec<R>,
    pull: Vec<R>,
    /// Elongations of the devices and their rates at this stage.
    pub(super) elongation: Vec<R>,
    pub(super) rate: Vec<R>,
    /// Work per time of the ground and of the damping, at this stage [W].
    input: R,
    damping: R,
}

impl<'a, R: Lanes> Plant<'a, R> {
    pub(super) fn at_rest(building: &'a Building) -> Self {
        let zero = || vec![R::splat(0.0); building.n];
        Self {
            building,
            displacement: zero(),
            velocity: zero(),
            staged_displacement: zero(),
            staged_velocity: zero(),
            next_displacement: zero(),
            next_velocity: zero(),
            acceleration: zero(),
            pull: zero(),
            elongation: vec![R::splat(0.0); building.n_devices()],
            rate: vec![R::splat(0.0); building.n_devices()],
            input: R::splat(0.0),
            damping: R::splat(0.0),
        }
    }

    /// Accelerations and powers at this stage, under these device forces and ground acceleration.
    pub(super) fn accelerate(&mut self, force: &[R], ground: R) {
        R::apart(Accelerate { plant: self, force, ground });
    }

    /// Adds this stage to the step and goes to the next; a step ends with the stage that reaches nowhere.
    pub(super) fn stage(
        &mut self,
        reductions: &mut Reductions<R>,
        force: &[R],
        step: f64,
        weight: f64,
        reach: f64,
    ) {
        R::apart(Stage { plant: self, reductions, force, step, weight, reach });
    }
}

struct Accelerate<'a, 'b, R> {
    plant: &'a mut Plant<'b, R>,
    force: &'a [R],
    ground: R,
}

impl<R: Lanes> Apart for Accelerate<'_, '_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { plant, force, ground } = self;
        let building = plant.building;
        let (mut damping, mut momentum) = (R::splat(0.0), R::splat(0.0));
        for coordinate in 0..building.n {
            let velocity = plant.staged_velocity[coordinate];
            let damped = building.damping.dot(coordinate, &plant.staged_velocity);
            damping = damped.mul_add(velocity, damping);
            momentum = velocity.mul_add(R::splat(building.pushed_mass[coordinate]), momentum);
            plant.pull[coordinate] =
                building.stiffness.add_dot(coordinate, &plant.staged_displacement, damped);
        }
        for (device, &force) in force.iter().enumerate() {
            for &(coordinate, reach) in building.devices.row(device) {
                plant.pull[coordinate] = force.mul_add(R::splat(reach), plant.pull[coordinate]);
            }
        }
        for coordinate in 0..building.n {
            let carried = ground * R::splat(-building.influence[coordinate]);
            plant.acceleration[coordinate] = carried - building.mass_inverse.dot(coordinate, &plant.pull);
        }
        plant.damping = damping;
        plant.input = -(momentum * ground);
    }
}

struct Stage<'a, 'b, R> {
    plant: &'a mut Plant<'b, R>,
    reductions: &'a mut Reductions<R>,
    force: &'a [R],
    step: f64,
    weight: f64,
    reach: f64,
}

impl<R: Lanes> Apart for Stage<'_, '_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { plant, reductions, force, step, .. } = self;
        let (weight, reach) = (R::splat(self.weight), R::splat(self.reach));
        let ends = self.reach == 0.0;
        reductions.input = plant.input.mul_add(weight, reductions.input);
        reductions.damping = plant.damping.mul_add(weight, reductions.damping);
        for (device, &force) in force.iter().enumerate() {
            let power = force * plant.rate[device];
            reductions.device_work[device] = power.mul_add(weight, reductions.device_work[device]);
        }
        let sixth = R::splat(if ends { 0.0 } else { step * step / 6.0 });
        for i in 0..plant.displacement.len() {
            let acceleration = plant.acceleration[i];
            plant.next_displacement[i] = acceleration.mul_add(sixth, plant.next_displacement[i]);
            plant.next_velocity[i] = acceleration.mul_add(weight, plant.next_velocity[i]);
            if ends {
                plant.displacement[i] = plant.next_displacement[i];
                plant.velocity[i] = plant.next_velocity[i];
                plant.staged_displacement[i] = plant.next_displacement[i];
                plant.staged_velocity[i] = plant.next_velocity[i];
                plant.next_displacement[i] =
                    plant.next_velocity[i].mul_add(R::splat(step), plant.next_displacement[i]);
            } else {
                plant.staged_displacement[i] = plant.staged_velocity[i].mul_add(reach, plant.displacement[i]);
                plant.staged_velocity[i] = acceleration.mul_add(reach, plant.velocity[i]);
            }
        }
        for device in 0..plant.elongation.len() {
            plant.elongation[device] = plant.building.devices.dot(device, &plant.staged_displacement);
            plant.rate[device] = plant.building.devices.dot(device, &plant.staged_velocity);
        }
    }
}
