//! The coordinates of a building in lanes, during the stages of a step.

use super::elements::Elements;
use super::reductions::{Motion, Reductions};
use crate::building::{Building, Coefficient, OfLanes, SpringRows};
use crate::lanes::{Lanes, OutOfLine};
use crate::real::Real;

/// Number of stages of a step.
const STAGES: usize = 4;

/// Motion of the coordinates.
///
/// Classical Runge-Kutta in the form for second-order systems: in a step the displacement increment is
/// h v + h^2 (a1 + a2 + a3)/6, the velocity increment h (a1 + 2 a2 + 2 a3 + a4)/6.
pub(super) struct Plant<'a, R: Real> {
    building: &'a Building,
    /// Its stiffness and damping.
    pub(super) springs: LaneSprings<'a, R>,
    step: f64,
    pub(super) displacement: Vec<R>,
    pub(super) velocity: Vec<R>,
    staged_displacement: Vec<R>,
    staged_velocity: Vec<R>,
    /// Accelerations relative to the ground, of each stage.
    accelerations: [Vec<R>; STAGES],
    /// Resisting force of each coordinate: stiffness, damping and devices [N].
    resisting: Vec<R>,
    /// Damping force of each coordinate [N].
    damped: Vec<R>,
    elements: Elements<'a, R>,
    /// Elongations of the devices and their rates at the current stage.
    pub(super) elongation: Vec<R>,
    pub(super) rate: Vec<R>,
    /// Power of the ground and of the damping at the current stage [W].
    input: R,
    damping: R,
}

impl<'a, R: Lanes> Plant<'a, R> {
    /// The building at rest; `springs` are those of each run, of one pattern.
    pub(super) fn at_rest(building: &'a Building, springs: &[&'a SpringRows<f64>], step: f64) -> Self {
        let zero = || vec![R::splat(0.0); building.n];
        Self {
            building,
            springs: LaneSprings::of(springs),
            step,
            displacement: zero(),
            velocity: zero(),
            staged_displacement: zero(),
            staged_velocity: zero(),
            accelerations: [zero(), zero(), zero(), zero()],
            resisting: zero(),
            damped: zero(),
            elements: Elements::at_rest(building),
            elongation: vec![R::splat(0.0); building.n_devices()],
            rate: vec![R::splat(0.0); building.n_devices()],
            input: R::splat(0.0),
            damping: R::splat(0.0),
        }
    }

    /// Accelerations relative to the ground at the start of the step.
    pub(super) fn acceleration(&self) -> &[R] {
        &self.accelerations[0]
    }

    /// Motion at the start of the step, and forces of the elements, once they were evaluated.
    pub(super) fn motion(&self) -> Motion<'_, R> {
        Motion {
            displacement: &self.displacement,
            velocity: &self.velocity,
            acceleration: &self.accelerations[0],
            element_force: &self.elements.force,
        }
    }

    /// Evaluates accelerations and powers at a stage, for these device forces and ground acceleration.
    pub(super) fn accelerate(&mut self, stage: usize, force: &[R], ground: &R) {
        self.elements.evaluate(if stage == 0 { &self.velocity } else { &self.staged_velocity });
        R::out_of_line(Accelerate { plant: self, stage, force, ground });
    }

    /// Adds the powers of a stage to the energies and moves to the next stage or, after the last, to the next step.
    pub(super) fn advance(&mut self, stage: usize, force: &[R], reductions: &mut Reductions<R>) {
        let Moves { weight, reach } = Moves::after(stage, self.step);
        self.elements.advance(weight, reach, reductions);
        R::out_of_line(AdvancePlant { plant: self, stage, force, reductions });
    }
}

/// Weight of a stage in the integrals over the step, and how far after the start of the step the next stage is [s].
struct Moves {
    weight: f64,
    reach: f64,
}

impl Moves {
    #[inline(always)]
    fn after(stage: usize, step: f64) -> Self {
        let last = stage == STAGES - 1;
        Self {
            weight: if stage == 0 || last { step / 6.0 } else { step / 3.0 },
            reach: match stage {
                _ if last => 0.0,
                _ if stage == STAGES - 2 => step,
                _ => 0.5 * step,
            },
        }
    }
}

/// Stiffness and damping in lanes: those of all runs, or of each.
pub(super) enum LaneSprings<'a, R> {
    Shared(&'a SpringRows<f64>),
    Each(SpringRows<OfLanes<R>>),
}

impl<'a, R: Lanes> LaneSprings<'a, R> {
    fn of(each: &[&'a SpringRows<f64>]) -> Self {
        if each.iter().all(|springs| core::ptr::eq(*springs, each[0])) {
            return Self::Shared(each[0]);
        }
        Self::Each(SpringRows::of_lanes(each))
    }

    /// Force of the stiffness on a coordinate [N].
    #[inline(always)]
    pub(super) fn sprung(&self, coordinate: usize, displacement: &[R]) -> R {
        match self {
            Self::Shared(springs) => springs.sprung(coordinate, displacement),
            Self::Each(springs) => springs.sprung(coordinate, displacement),
        }
    }
}

struct Accelerate<'a, 'b, R: Real> {
    plant: &'a mut Plant<'b, R>,
    stage: usize,
    force: &'a [R],
    ground: &'a R,
}

impl<R: Lanes> OutOfLine for Accelerate<'_, '_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { plant, stage, force, ground } = self;
        let building = plant.building;
        let n = building.n;
        // Slices of one length: pointers and bounds are read once, not in every product.
        let (displacement, velocity) = match stage {
            0 => (&plant.displacement[..n], &plant.velocity[..n]),
            _ => (&plant.staged_displacement[..n], &plant.staged_velocity[..n]),
        };
        let pushes = Pushes {
            building,
            displacement,
            velocity,
            force,
            element_force: &plant.elements.force,
            ground: *ground,
        };
        let (resisting, damped) = (&mut plant.resisting[..n], &mut plant.damped[..n]);
        let acceleration = &mut plant.accelerations[stage][..n];
        match &plant.springs {
            LaneSprings::Shared(springs) => pushes.accelerate(springs, resisting, damped, acceleration),
            LaneSprings::Each(springs) => pushes.accelerate(springs, resisting, damped, acceleration),
        }
        // In a loop of their own: with the products above, two sums more would not stay in registers.
        let (mut damping, mut momentum) = (R::splat(0.0), R::splat(0.0));
        let pushed_mass = &building.pushed_mass[..n];
        for coordinate in 0..n {
            let own = velocity[coordinate];
            damping = damped[coordinate].mul_add(own, damping);
            momentum = own.mul_add(R::splat(pushed_mass[coordinate]), momentum);
        }
        plant.damping = damping;
        plant.input = -(momentum * *ground);
    }
}

/// What acts on the coordinates at a stage.
struct Pushes<'a, R: Real> {
    building: &'a Building,
    displacement: &'a [R],
    velocity: &'a [R],
    force: &'a [R],
    element_force: &'a [R],
    ground: R,
}

impl<R: Lanes> Pushes<'_, R> {
    /// Writes the accelerations relative to the ground, and the damping force on each coordinate.
    #[inline(always)]
    fn accelerate<N: Coefficient<R>>(
        &self,
        springs: &SpringRows<N>,
        resisting: &mut [R],
        damped: &mut [R],
        acceleration: &mut [R],
    ) {
        let Self { building, displacement, velocity, force, element_force, ground } = *self;
        let n = displacement.len();
        let influence = &building.influence[..n];
        for coordinate in 0..n {
            let [of_springs, of_damping] = springs.coupling(coordinate, displacement, velocity);
            damped[coordinate] = of_damping;
            let mut sum = of_springs + of_damping;
            for &(device, reach) in building.pushing_devices.row(coordinate) {
                sum = force[device].mul_add(R::splat(reach), sum);
            }
            for &(element, reach) in building.pushing_elements.row(coordinate) {
                sum = element_force[element].mul_add(R::splat(reach), sum);
            }
            match &building.per_mass {
                Some(per_mass) => {
                    let pushed = ground * R::splat(-influence[coordinate]);
                    acceleration[coordinate] = sum.mul_add(R::splat(-per_mass[coordinate]), pushed);
                }
                None => resisting[coordinate] = sum,
            }
        }
        if building.per_mass.is_none() {
            building.accelerate(resisting, ground, acceleration);
        }
    }
}

struct AdvancePlant<'a, 'b, R: Real> {
    plant: &'a mut Plant<'b, R>,
    stage: usize,
    force: &'a [R],
    reductions: &'a mut Reductions<R>,
}

impl<R: Lanes> OutOfLine for AdvancePlant<'_, '_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { plant, stage, force, reductions } = self;
        // Not handed over: two numbers that are stored one by one and read as a pair hold up the processor.
        let Moves { weight, reach } = Moves::after(stage, plant.step);
        let weight = R::splat(weight);
        reductions.input = plant.input.mul_add(weight, reductions.input);
        reductions.damping = plant.damping.mul_add(weight, reductions.damping);
        for (device, &force) in force.iter().enumerate() {
            let power = force * plant.rate[device];
            reductions.device_work[device] = power.mul_add(weight, reductions.device_work[device]);
        }
        if stage == STAGES - 1 {
            plant.end();
        } else {
            plant.reach(stage, R::splat(reach));
        }
        let (displacement, velocity) = match stage {
            _ if stage == STAGES - 1 => (&plant.displacement, &plant.velocity),
            _ => (&plant.staged_displacement, &plant.staged_velocity),
        };
        for device in 0..plant.elongation.len() {
            plant.elongation[device] = plant.building.devices.dot(device, displacement);
            plant.rate[device] = plant.building.devices.dot(device, velocity);
        }
    }
}

impl<R: Lanes> Plant<'_, R> {
    /// Evaluates the motion `reach` after the start of the step, with the velocity and acceleration of a stage.
    #[inline(always)]
    fn reach(&mut self, stage: usize, reach: R) {
        let n = self.building.n;
        let (displacement, velocity) = (&self.displacement[..n], &self.velocity[..n]);
        let acceleration = &self.accelerations[stage][..n];
        let staged_displacement = &mut self.staged_displacement[..n];
        let staged_velocity = &mut self.staged_velocity[..n];
        if stage == 0 {
            for i in 0..n {
                staged_displacement[i] = velocity[i].mul_add(reach, displacement[i]);
                staged_velocity[i] = acceleration[i].mul_add(reach, velocity[i]);
            }
            return;
        }
        for i in 0..n {
            staged_displacement[i] = staged_velocity[i].mul_add(reach, displacement[i]);
            staged_velocity[i] = acceleration[i].mul_add(reach, velocity[i]);
        }
    }

    /// Completes the step.
    #[inline(always)]
    fn end(&mut self) {
        let n = self.building.n;
        let step = R::splat(self.step);
        let (sixth, third) = (R::splat(self.step / 6.0), R::splat(self.step / 3.0));
        let square = R::splat(self.step * self.step / 6.0);
        let [first, second, third_stage, last] = &self.accelerations;
        let (first, second, third_stage, last) = (&first[..n], &second[..n], &third_stage[..n], &last[..n]);
        let (displacement, velocity) = (&mut self.displacement[..n], &mut self.velocity[..n]);
        for i in 0..n {
            let middle = second[i] + third_stage[i];
            let drifted = velocity[i].mul_add(step, displacement[i]);
            displacement[i] = (first[i] + middle).mul_add(square, drifted);
            velocity[i] = middle.mul_add(third, (first[i] + last[i]).mul_add(sixth, velocity[i]));
        }
    }
}
