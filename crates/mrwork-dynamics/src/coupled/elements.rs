//! Passive elements of a building in lanes: loops that yield and losses of head, which follow no command.

use super::energies::Energies;
use super::stages::stages;
use crate::building::{Building, Element};
use crate::damper::Hysteresis;
use crate::lanes::Lanes;
use crate::real::{OutOfLine, Real, within};

/// Share of the dissipative term of the loop: it unloads with the slope with which it began to load.
pub(crate) const UNLOADING: f64 = 0.5;
/// Steps in which the loops follow a motion from sample to sample.
const STEPS_OF_SAMPLE: u32 = 2;

/// All elements, during the stages of a step.
pub(super) struct Elements<'a, R: Real> {
    building: &'a Building,
    loops: Vec<Loop<R>>,
    /// Rates of the elongations at the current stage [m/s].
    velocity: Vec<R>,
    /// Force with which each element resists, but for its spring and dashpot, which are the building's [N].
    pub(super) force: Vec<R>,
}

/// The loop of an element: w in [-1, 1].
struct Loop<R: Real> {
    hysteresis: Hysteresis<R>,
    now: R,
    staged: R,
    rate: R,
    next: R,
    /// Yield force and yield displacement over those of the building, and its inverse.
    strength: R,
    per_strength: R,
}

impl<'a, R: Lanes> Elements<'a, R> {
    pub(super) fn at_rest(building: &'a Building) -> Self {
        let zero = R::splat(0.0);
        let at_rest = |element: &Element| {
            let numbers = [element.slope, UNLOADING, element.sharpness].map(R::splat);
            let (hysteresis, one) = (Hysteresis::of(numbers), R::splat(1.0));
            Loop {
                hysteresis,
                now: zero,
                staged: zero,
                rate: zero,
                next: zero,
                strength: one,
                per_strength: one,
            }
        };
        Self {
            building,
            loops: building.element_parameters.iter().map(at_rest).collect(),
            velocity: vec![zero; building.n_elements()],
            force: vec![zero; building.n_elements()],
        }
    }

    /// Energy that a loop gives back when it unloads, `f_y w^2 / (2 rho)` [J].
    #[inline(always)]
    pub(super) fn held_by(&self, element: usize) -> R {
        let Element { yield_force, slope, .. } = self.building.element_parameters[element];
        let Loop { now, strength, .. } = self.loops[element];
        let w = now * strength;
        w * w * R::splat(0.5 * yield_force / slope)
    }

    /// Square of the largest elongation that storeys which yield keep when they unload, `x - w / rho` [m^2].
    #[inline(always)]
    pub(super) fn left_squared(&self, displacement: &[R]) -> R {
        let mut largest = R::splat(0.0);
        for (index, own) in self.loops.iter().enumerate() {
            let Element { slope, in_frame, .. } = self.building.element_parameters[index];
            if in_frame {
                let elastic = own.now * own.strength;
                let x = self.building.elements.dot(index, displacement);
                let left = elastic.weighted(R::splat(-1.0 / slope), x);
                largest = (left * left).max(largest);
            }
        }
        largest
    }

    /// States of the loops, one of each element.
    pub(super) fn save(&self, into: &mut [R]) {
        for (state, own) in into.iter_mut().zip(&self.loops) {
            *state = own.now;
        }
    }

    /// Goes on from these states.
    #[inline(always)]
    pub(super) fn place(&mut self, states: &[R]) {
        for (&state, own) in states.iter().zip(&mut self.loops) {
            (own.now, own.staged, own.next) = (state, state, state);
        }
    }

    /// Follows the loops along a change of the coordinates, straight and in unit time: their path is what counts.
    #[inline(always)]
    pub(super) fn follow(&mut self, change: &[R]) {
        let step = 1.0 / f64::from(STEPS_OF_SAMPLE);
        for _ in 0..STEPS_OF_SAMPLE {
            for stage in stages(step) {
                self.evaluate(change);
                self.advance(stage.weight, stage.reach, None);
            }
            self.evaluate(change);
            self.advance(step / 6.0, 0.0, None);
        }
    }

    /// Changes yield force and yield displacement of an element, over those of the building, within limits.
    #[inline(always)]
    pub(super) fn strengthen(&mut self, element: usize, change: R, [least, most]: [R; 2]) {
        let own = &mut self.loops[element];
        own.strength = within(own.strength + change, least, most);
        own.per_strength = R::splat(1.0) / own.strength;
    }

    /// Visits strength and inverse strength of each loop.
    pub(super) fn each_strength(&mut self, visit: &mut dyn FnMut(&mut R)) {
        for own in &mut self.loops {
            visit(&mut own.strength);
            visit(&mut own.per_strength);
        }
    }

    /// State of a loop.
    #[inline(always)]
    pub(super) fn state(&self, element: usize) -> R {
        self.loops[element].now
    }

    /// Evaluates forces and rates of the loops at a stage with these velocities of the coordinates.
    pub(super) fn evaluate(&mut self, velocity: &[R]) {
        if !self.force.is_empty() {
            R::out_of_line(Evaluate { elements: self, velocity });
        }
    }

    /// Adds a weighted stage to the loops and to the work, and moves `reach` ahead for the next; zero ends the step.
    ///
    /// A model, which counts no work, takes steps that are long for a sharp knee: its loops are held to [-1, 1].
    pub(super) fn advance(&mut self, weight: f64, reach: f64, energies: Option<&mut Energies<R>>) {
        if !self.force.is_empty() {
            R::out_of_line(Advance { elements: self, weight, reach, energies });
        }
    }
}

struct Evaluate<'a, 'b, R: Real> {
    elements: &'a mut Elements<'b, R>,
    velocity: &'a [R],
}

impl<R: Lanes> OutOfLine for Evaluate<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { elements, velocity } = self;
        for (index, own) in elements.loops.iter_mut().enumerate() {
            let Element { head_loss, yield_force, .. } = elements.building.element_parameters[index];
            let v = elements.building.elements.dot(index, velocity);
            own.rate = own.hysteresis.rate(own.staged, v * own.per_strength);
            elements.velocity[index] = v;
            let yielding = own.staged * own.strength * R::splat(yield_force);
            elements.force[index] = (v.abs() * v).weighted(R::splat(head_loss), yielding);
        }
    }
}

struct Advance<'a, 'b, R: Real> {
    elements: &'a mut Elements<'b, R>,
    weight: f64,
    reach: f64,
    energies: Option<&'a mut Energies<R>>,
}

impl<R: Lanes> OutOfLine for Advance<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { elements, energies, .. } = self;
        let (weight, reach) = (R::splat(self.weight), R::splat(self.reach));
        let limited = energies.is_none();
        if let Some(energies) = energies {
            for index in 0..elements.loops.len() {
                let (force, velocity) = (elements.force[index], elements.velocity[index]);
                energies.elements[index] = (force * velocity).weighted(weight, energies.elements[index]);
                let damping = R::splat(elements.building.element_parameters[index].damping);
                let power = velocity.weighted(damping, force) * velocity;
                energies.with_dashpots[index] = power.weighted(weight, energies.with_dashpots[index]);
            }
        }
        for own in &mut elements.loops {
            own.next = own.rate.weighted(weight, own.next);
            if self.reach == 0.0 {
                own.now = own.next;
                if limited {
                    own.now = within(own.now, R::splat(-1.0), R::splat(1.0));
                    own.next = own.now;
                }
            }
            own.staged = own.rate.weighted(reach, own.now);
            if limited {
                own.staged = within(own.staged, R::splat(-1.0), R::splat(1.0));
            }
        }
    }
}
