//! The coordinates of a building in lanes, during the stages of a step.

use super::elements::Elements;
use super::energies::Energies;
use crate::building::{Building, Coefficient, Element, Link, OfLanes, SparseRows, SpringRows};
use crate::lanes::Lanes;
use crate::real::{OutOfLine, Real};

/// Number of stages of a step.
const STAGES: usize = 4;
/// The last of them.
const LAST: usize = STAGES - 1;

/// Motion of the coordinates.
///
/// Classical Runge-Kutta in the form for second-order systems: in a step the displacement increment is
/// h v + h^2 (a1 + a2 + a3)/6, the velocity increment h (a1 + 2 a2 + 2 a3 + a4)/6.
pub(crate) struct Plant<'a, R: Lanes> {
    building: &'a Building,
    /// Its stiffness and damping.
    pub(crate) springs: LaneSprings<'a, R>,
    step: f64,
    pub(crate) displacement: Vec<R>,
    pub(crate) velocity: Vec<R>,
    staged_displacement: Vec<R>,
    staged_velocity: Vec<R>,
    /// Accelerations relative to the ground, of each stage.
    accelerations: [Vec<R>; STAGES],
    /// Resisting force of each coordinate of a building that is no chain [N].
    resisting: Vec<R>,
    /// Passive elements.
    elements: Elements<'a, R>,
    /// Accelerations of the coordinates beside those of the equations, which a controller has measured; empty for none.
    pub(crate) offset: Vec<R>,
    /// Minus the forces on the floors at start, middle and end of the step [N]; empty for none.
    pub(crate) on_floors: [Vec<R>; 3],
    /// Elongations of the devices and their rates at the current stage.
    pub(crate) elongation: Vec<R>,
    pub(crate) rate: Vec<R>,
    /// Powers of ground and forces, and of the damping, at the start of the step [W].
    powers: [R; 2],
}

/// Motion of the coordinates relative to the ground at the start of a step.
#[derive(Clone, Copy)]
pub(crate) struct PlantMotion<'a, R> {
    pub(crate) displacement: &'a [R],
    pub(crate) velocity: &'a [R],
    pub(crate) acceleration: &'a [R],
    /// Forces of the elements, but for their springs and dashpots [N].
    pub(crate) element_force: &'a [R],
}

impl<R: Real> PlantMotion<'_, R> {
    /// Elongation, rate and whole force of an element.
    #[inline(always)]
    pub(crate) fn of_element(&self, building: &Building, element: usize) -> [R; 3] {
        let x = building.elements.dot(element, self.displacement);
        let v = building.elements.dot(element, self.velocity);
        let force = building.element_parameters[element].with_spring(self.element_force[element], x, v);
        [x, v, force]
    }
}

impl<'a, R: Lanes> Plant<'a, R> {
    /// The building at rest with its passive elements; `springs` are those of each run, of one pattern.
    pub(crate) fn at_rest(building: &'a Building, springs: &[&'a SpringRows<f64>], step: f64) -> Self {
        let zero = || vec![R::splat(0.0); building.n];
        let per_device = || vec![R::splat(0.0); building.n_devices()];
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
            elements: Elements::at_rest(building),
            offset: Vec::new(),
            on_floors: [Vec::new(), Vec::new(), Vec::new()],
            elongation: per_device(),
            rate: per_device(),
            powers: [R::splat(0.0); 2],
        }
    }

    /// Energy that the loop of an element holds [J].
    #[inline(always)]
    pub(crate) fn held_by(&self, element: usize) -> R {
        self.elements.held_by(element)
    }

    /// Twice the energy that the building holds [J]: of its springs, in the loops of its elements, and in its motion.
    #[inline(always)]
    pub(crate) fn twice_held(&self) -> R {
        let Self { building, springs, displacement, velocity, .. } = self;
        let mut sum = R::splat(0.0);
        for coordinate in 0..building.n {
            sum = springs.sprung(coordinate, displacement).mul_add(displacement[coordinate], sum);
            sum = building.mass.dot(coordinate, velocity).mul_add(velocity[coordinate], sum);
        }
        for element in 0..building.n_elements() {
            sum = self.held_by(element).weighted(R::splat(2.0), sum);
        }
        sum
    }

    /// Square of the largest drift that storeys which yield keep when they unload [m^2].
    #[inline(always)]
    pub(crate) fn left_squared(&self) -> R {
        self.elements.left_squared(&self.displacement)
    }

    /// Writes the states of the loops of the elements.
    pub(crate) fn save_loops(&self, into: &mut [R]) {
        self.elements.save(into);
    }

    /// Goes on from these states of the loops.
    #[inline(always)]
    pub(crate) fn place_loops(&mut self, states: &[R]) {
        self.elements.place(states);
    }

    /// Follows the loops along a change of the coordinates, straight.
    #[inline(always)]
    pub(crate) fn follow(&mut self, change: &[R]) {
        self.elements.follow(change);
    }

    /// Adapts the strength of the loops to what storeys resist beyond them [N]: by this share of it over the yield force,
    /// as far as they yield.
    #[inline(always)]
    pub(crate) fn adapt(&mut self, missed: &[R], share: f64, limits: [R; 2]) {
        let Self { building, elements, .. } = self;
        for (storey, &missed) in missed.iter().enumerate() {
            for &(element, _) in building.shears.yielding.row(storey) {
                let Element { yield_force, .. } = building.element_parameters[element];
                if yield_force > 0.0 {
                    let w = elements.state(element);
                    let change = w.abs() * w * missed * R::splat(share / yield_force);
                    elements.strengthen(element, change, limits);
                }
            }
        }
    }

    /// Visits strength and inverse strength of each loop of an element.
    pub(crate) fn each_strength(&mut self, visit: &mut dyn FnMut(&mut R)) {
        self.elements.each_strength(visit);
    }

    pub(crate) fn building(&self) -> &'a Building {
        self.building
    }

    /// Length of a step [s].
    pub(crate) fn step(&self) -> f64 {
        self.step
    }

    pub(crate) fn set_step(&mut self, step: f64) {
        self.step = step;
    }

    /// Goes on from this motion.
    #[inline(always)]
    pub(crate) fn place(&mut self, displacement: &[R], velocity: &[R]) {
        self.displacement.copy_from_slice(displacement);
        self.velocity.copy_from_slice(velocity);
        for device in 0..self.elongation.len() {
            self.elongation[device] = self.building.devices.dot(device, displacement);
            self.rate[device] = self.building.devices.dot(device, velocity);
        }
    }

    /// Motion at the start of the step, and forces of the elements, once they were evaluated.
    pub(crate) fn motion(&self) -> PlantMotion<'_, R> {
        PlantMotion {
            displacement: &self.displacement,
            velocity: &self.velocity,
            acceleration: &self.accelerations[0],
            element_force: &self.elements.force,
        }
    }

    /// Evaluates accelerations and powers at the start of a step, for these device forces and ground acceleration.
    pub(crate) fn accelerate(&mut self, force: &[R], ground: &R) {
        self.elements.evaluate(&self.velocity);
        R::out_of_line(Accelerate { plant: self, force, ground });
    }

    /// Moves from the start of a step, once it was evaluated, to the next stage; adds its powers to the energies.
    pub(crate) fn advance(&mut self, force: &[R], mut energies: Option<&mut Energies<R>>) {
        let Moves { weight, reach } = Moves::after(0, self.step);
        self.elements.advance(weight, reach, energies.as_deref_mut());
        R::out_of_line(Advance { plant: self, force, energies });
    }

    /// Evaluates a later stage, for these device forces and ground acceleration, adds its powers to the energies, and moves
    /// to the next stage or, after the last, to the next step.
    pub(crate) fn pass(
        &mut self,
        stage: usize,
        force: &[R],
        ground: &R,
        mut energies: Option<&mut Energies<R>>,
    ) {
        let Moves { weight, reach } = Moves::after(stage, self.step);
        self.elements.evaluate(&self.staged_velocity);
        self.elements.advance(weight, reach, energies.as_deref_mut());
        R::out_of_line(Pass { plant: self, stage, force, ground, energies });
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
        Self {
            weight: if stage == 0 || stage == LAST { step / 6.0 } else { step / 3.0 },
            reach: match stage {
                LAST => 0.0,
                _ if stage == LAST - 1 => step,
                _ => 0.5 * step,
            },
        }
    }
}

/// Stiffness and damping in lanes: those of all runs, or of each.
pub(crate) enum LaneSprings<'a, R> {
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

    /// Whether the coordinates are a chain, each connected to its neighbours alone.
    fn is_chain(&self) -> bool {
        match self {
            Self::Shared(springs) => springs.is_chain(),
            Self::Each(springs) => springs.is_chain(),
        }
    }

    /// Forces of the stiffness and of the damping on a coordinate [N].
    #[inline(always)]
    fn coupling(&self, coordinate: usize, displacement: &[R], velocity: &[R]) -> [R; 2] {
        match self {
            Self::Shared(springs) => springs.coupling(coordinate, displacement, velocity),
            Self::Each(springs) => springs.coupling(coordinate, displacement, velocity),
        }
    }

    /// Force of the stiffness on a coordinate [N].
    #[inline(always)]
    pub(crate) fn sprung(&self, coordinate: usize, displacement: &[R]) -> R {
        match self {
            Self::Shared(springs) => springs.sprung(coordinate, displacement),
            Self::Each(springs) => springs.sprung(coordinate, displacement),
        }
    }
}

struct Accelerate<'a, 'b, R: Lanes> {
    plant: &'a mut Plant<'b, R>,
    force: &'a [R],
    ground: &'a R,
}

impl<R: Lanes> OutOfLine for Accelerate<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { plant, force, ground } = self;
        plant.accelerate_at(0, force, ground, None);
    }
}

struct Advance<'a, 'b, R: Lanes> {
    plant: &'a mut Plant<'b, R>,
    force: &'a [R],
    energies: Option<&'a mut Energies<R>>,
}

impl<R: Lanes> OutOfLine for Advance<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { plant, force, mut energies } = self;
        if let Some(energies) = energies.as_deref_mut() {
            energies.add(plant.powers, Moves::after(0, plant.step).weight);
        }
        plant.leave(0, force, energies);
    }
}

struct Pass<'a, 'b, R: Lanes> {
    plant: &'a mut Plant<'b, R>,
    stage: usize,
    force: &'a [R],
    ground: &'a R,
    energies: Option<&'a mut Energies<R>>,
}

impl<R: Lanes> OutOfLine for Pass<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { plant, stage, force, ground, energies } = self;
        let mut energies = energies;
        plant.accelerate_at(stage, force, ground, energies.as_deref_mut());
        plant.leave(stage, force, energies);
    }
}

impl<R: Lanes> Plant<'_, R> {
    /// Writes the accelerations at a stage; adds the work of the ground, of forces on floors and of the damping to the
    /// energies or, without these, keeps their powers.
    #[inline(always)]
    fn accelerate_at(&mut self, stage: usize, force: &[R], ground: &R, energies: Option<&mut Energies<R>>) {
        let Self { building, springs, resisting, elements, offset, on_floors, .. } = self;
        let on_floors = &on_floors[stage.div_ceil(2)][..];
        let n = building.n;
        let (displacement, velocity) = match stage {
            0 => (&self.displacement[..n], &self.velocity[..n]),
            _ => (&self.staged_displacement[..n], &self.staged_velocity[..n]),
        };
        let at = At { building, displacement, velocity, ground };
        let acceleration = &mut self.accelerations[stage][..n];
        let element_force = &elements.force[..];
        let mut powers = if let Some(per_mass) = &building.per_mass {
            let powers = match (&*springs, springs.is_chain()) {
                (LaneSprings::Shared(springs), true) => at.chain(springs.links(), per_mass, acceleration),
                (LaneSprings::Each(springs), true) => at.chain(springs.links(), per_mass, acceleration),
                (_, false) => {
                    let powers = at.resist(springs, resisting);
                    for i in 0..n {
                        let pushed = *ground * R::splat(-building.influence[i]);
                        acceleration[i] = resisting[i].weighted(R::splat(-per_mass[i]), pushed);
                    }
                    powers
                }
            };
            push(acceleration, force, &building.devices, Some(per_mass));
            push(acceleration, element_force, &building.elements, Some(per_mass));
            push(acceleration, on_floors, &building.floors, Some(per_mass));
            powers
        } else {
            let powers = at.resist(springs, resisting);
            push(resisting, force, &building.devices, None);
            push(resisting, element_force, &building.elements, None);
            push(resisting, on_floors, &building.floors, None);
            for (coordinate, acceleration) in acceleration.iter_mut().enumerate() {
                *acceleration = building.acceleration(coordinate, resisting, *ground);
            }
            powers
        };
        for (coordinate, &offset) in offset.iter().enumerate() {
            acceleration[coordinate] = acceleration[coordinate] + offset;
        }
        for (floor, &minus) in on_floors.iter().enumerate() {
            powers[0] = powers[0] - minus * building.floors.dot(floor, velocity);
        }
        if let Some(energies) = energies {
            energies.add(powers, Moves::after(stage, self.step).weight);
        } else {
            self.powers = powers;
        }
    }

    /// Adds the work of the devices at a stage to the energies, and moves to the next stage or completes the step.
    #[inline(always)]
    fn leave(&mut self, stage: usize, force: &[R], energies: Option<&mut Energies<R>>) {
        if let Some(energies) = energies {
            let weight = R::splat(Moves::after(stage, self.step).weight);
            for (device, &force) in force.iter().enumerate() {
                let power = force * self.rate[device];
                energies.devices[device] = power.weighted(weight, energies.devices[device]);
            }
        }
        if stage == LAST {
            self.end();
        } else {
            self.reach(stage);
        }
        let (displacement, velocity) = match stage {
            LAST => (&self.displacement, &self.velocity),
            _ => (&self.staged_displacement, &self.staged_velocity),
        };
        for device in 0..self.elongation.len() {
            self.elongation[device] = self.building.devices.dot(device, displacement);
            self.rate[device] = self.building.devices.dot(device, velocity);
        }
    }

    /// The motion at the stage after this one.
    #[inline(always)]
    fn reach(&mut self, stage: usize) {
        let n = self.building.n;
        let reach = R::splat(Moves::after(stage, self.step).reach);
        let (displacement, velocity) = (&self.displacement[..n], &self.velocity[..n]);
        let acceleration = &self.accelerations[stage][..n];
        let staged_displacement = &mut self.staged_displacement[..n];
        let staged_velocity = &mut self.staged_velocity[..n];
        if stage == 0 {
            for i in 0..n {
                staged_displacement[i] = velocity[i].weighted(reach, displacement[i]);
                staged_velocity[i] = acceleration[i].weighted(reach, velocity[i]);
            }
            return;
        }
        for i in 0..n {
            staged_displacement[i] = staged_velocity[i].weighted(reach, displacement[i]);
            staged_velocity[i] = acceleration[i].weighted(reach, velocity[i]);
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
            let drifted = velocity[i].weighted(step, displacement[i]);
            displacement[i] = (first[i] + middle).weighted(square, drifted);
            velocity[i] = middle.weighted(third, (first[i] + last[i]).weighted(sixth, velocity[i]));
        }
    }
}

/// Adds forces to what resists at the coordinates on which they act, or takes what they accelerate from accelerations.
#[inline(always)]
fn push<R: Real>(coordinates: &mut [R], force: &[R], rows: &SparseRows, per_mass: Option<&[f64]>) {
    for (number, &force) in force.iter().enumerate() {
        for &(coordinate, reach) in rows.row(number) {
            let share = per_mass.map_or(reach, |per_mass| -reach * per_mass[coordinate]);
            coordinates[coordinate] = force.weighted(R::splat(share), coordinates[coordinate]);
        }
    }
}

/// The coordinates at a stage.
struct At<'a, R> {
    building: &'a Building,
    displacement: &'a [R],
    velocity: &'a [R],
    ground: &'a R,
}

impl<R: Lanes> At<'_, R> {
    /// Writes the accelerations of a chain relative to the ground, without the forces of devices and elements; returns the
    /// powers of the ground and of the damping.
    ///
    /// Vector by vector, one coordinate after the other: displacement and velocity of the neighbours stay in registers.
    #[inline(always)]
    fn chain<N: Coefficient<R>>(
        &self,
        links: &[Link<N>],
        per_mass: &[f64],
        acceleration: &mut [R],
    ) -> [R; 2] {
        let n = links.len();
        let (displacement, velocity) = (&self.displacement[..n], &self.velocity[..n]);
        let (per_mass, acceleration) = (&per_mass[..n], &mut acceleration[..n]);
        let influence = &self.building.influence[..n];
        let pushed_mass = &self.building.pushed_mass[..n];
        let zero = R::Piece::splat(0.0);
        let mut powers = [R::splat(0.0); 2];
        for vector in 0..R::PIECES {
            let ground = self.ground.piece(vector);
            let (mut damping, mut momentum) = (zero, zero);
            let mut below = [zero; 2];
            let mut own = [displacement[0].piece(vector), velocity[0].piece(vector)];
            for i in 0..n {
                // Beyond the end of the chain nothing is connected.
                let next = if i + 1 < n { i + 1 } else { i };
                let above = [displacement[next].piece(vector), velocity[next].piece(vector)];
                let [of_springs, of_damping] = links[i].coupling(vector, below, own, above);
                damping = of_damping.mul_add(own[1], damping);
                momentum = own[1].weighted(R::Piece::splat(pushed_mass[i]), momentum);
                let pushed = ground * R::Piece::splat(-influence[i]);
                let moved = (of_springs + of_damping).weighted(R::Piece::splat(-per_mass[i]), pushed);
                acceleration[i].set_piece(vector, moved);
                (below, own) = (own, above);
            }
            powers[0].set_piece(vector, -(momentum * ground));
            powers[1].set_piece(vector, damping);
        }
        powers
    }

    /// Writes what resists at each coordinate of any building; returns the powers of the ground and of the damping.
    #[inline(always)]
    fn resist(&self, springs: &LaneSprings<'_, R>, resisting: &mut [R]) -> [R; 2] {
        let (mut damping, mut momentum) = (R::splat(0.0), R::splat(0.0));
        for (i, resisting) in resisting.iter_mut().enumerate() {
            let [of_springs, of_damping] = springs.coupling(i, self.displacement, self.velocity);
            *resisting = of_springs + of_damping;
            damping = of_damping.mul_add(self.velocity[i], damping);
            momentum = self.velocity[i].weighted(R::splat(self.building.pushed_mass[i]), momentum);
        }
        [-(momentum * *self.ground), damping]
    }
}
