//! Integration of the controller's model of the loop: building, dampers and driver as one system, by classical
//! Runge-Kutta as in the loop itself, with a longer step.

use super::super::loop_model::LoopModel;
use crate::building::Building;
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Motion, State};
use crate::elementary::exp;
use crate::lanes::{Lanes, OutOfLine};
use crate::parameters::{FromSlice, offsets};

const STAGES: usize = 4;

/// Motion of the model at an instant, with the states of its dampers.
pub(super) struct Moment<M: DamperModel, R: Lanes> {
    pub(super) displacement: Vec<R>,
    pub(super) velocity: Vec<R>,
    /// Current in the coil of each device.
    pub(super) current: Vec<R>,
    /// States of the dampers on each side of each device.
    pub(super) states: Vec<M::State<R>>,
}

impl<M: DamperModel, R: Lanes> Moment<M, R> {
    /// At rest.
    pub(super) fn of(prediction: &Prediction<'_, M, R>) -> Self {
        let zero = R::splat(0.0);
        Self {
            displacement: vec![zero; prediction.building.n],
            velocity: vec![zero; prediction.building.n],
            current: vec![zero; prediction.n_devices()],
            states: vec![M::State::from_fn(|_| zero); prediction.n_sides],
        }
    }

    #[inline(always)]
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.displacement.copy_from_slice(&other.displacement);
        self.velocity.copy_from_slice(&other.velocity);
        self.current.copy_from_slice(&other.current);
        self.states.copy_from_slice(&other.states);
    }
}

/// A device of the model.
struct Device<M: DamperModel, R: Lanes> {
    /// Prepared.
    columns: Vec<R>,
    /// Parameters at the present current.
    values: Vec<R>,
    /// Rate of the lag of its driver.
    lag: R,
    /// Parameters that count as zero: two dampers in opposition are computed as one with twice the force and no offset.
    cancelled: Vec<usize>,
    /// Index of its first side among those of all devices, and the sign and number of dampers of each.
    first: usize,
    sides: Vec<[f64; 2]>,
    /// Parameters at the present current.
    at: M::Parameters<R>,
}

/// The equations of the model, with what a step needs.
pub(super) struct Prediction<'a, M: DamperModel, R: Lanes> {
    pub(super) building: &'a Building,
    laws: &'a CurrentLaws,
    follows: bool,
    pub(super) lagged: bool,
    devices: Vec<Device<M, R>>,
    pub(super) n_sides: usize,
    /// Factor on the force of each device.
    pub(super) scale: Vec<R>,
    /// Accelerations relative to the ground at the present instant.
    pub(super) acceleration: Vec<R>,
    /// Rates of the damper states there.
    rates: Vec<M::State<R>>,
    pub(super) force: Vec<R>,
    resisting: Vec<R>,
}

/// Moments within a step and at its end.
pub(super) struct Scratch<M: DamperModel, R: Lanes> {
    staged: Moment<M, R>,
    next: Moment<M, R>,
}

impl<M: DamperModel, R: Lanes> Scratch<M, R> {
    pub(super) fn of(prediction: &Prediction<'_, M, R>) -> Self {
        Self { staged: Moment::of(prediction), next: Moment::of(prediction) }
    }
}

impl<'a, M: DamperModel, R: Lanes> Prediction<'a, M, R> {
    pub(super) fn new(model: &LoopModel<'a>) -> Self {
        let LoopModel { building, laws, mountings, .. } = *model;
        let (n, n_devices) = (building.n, mountings.len());
        let zero = R::splat(0.0);
        let values = vec![R::splat(f64::NAN); laws.n_params()];
        let mut devices: Vec<Device<M, R>> = Vec::with_capacity(n_devices);
        let mut n_sides = 0;
        for (index, mounting) in mountings.iter().enumerate() {
            let theta = model.theta_of(index);
            let merged = mounting.differential && M::SPEC.odd && M::SPEC.offset_adds;
            let sides = match (merged, mounting.differential) {
                (true, _) => vec![[1.0, 2.0 * mounting.count]],
                (false, true) => vec![[1.0, mounting.count], [-1.0, -mounting.count]],
                (false, false) => vec![[1.0, mounting.count]],
            };
            devices.push(Device {
                columns: theta.iter().map(|&value| R::splat(value)).collect(),
                lag: R::splat(laws.lag_column().map_or(0.0, |column| theta[column])),
                cancelled: if merged { offsets(M::SPEC.parameters) } else { Vec::new() },
                first: n_sides,
                at: M::Parameters::from_slice(&values),
                values: values.clone(),
                sides,
            });
            n_sides += devices[index].sides.len();
        }
        let mut prediction = Self {
            building,
            laws,
            follows: !laws.are_constant(),
            lagged: laws.lag_column().is_some(),
            devices,
            n_sides,
            scale: vec![R::splat(1.0); n_devices],
            acceleration: vec![zero; n],
            rates: vec![M::State::from_fn(|_| zero); n_sides],
            force: vec![zero; n_devices],
            resisting: vec![zero; n],
        };
        R::out_of_line(Prepare { prediction: &mut prediction });
        prediction
    }

    /// Number of devices.
    pub(super) fn n_devices(&self) -> usize {
        self.devices.len()
    }

    /// Share of the difference of current and command that is left after a time; none without a lag.
    #[inline(always)]
    pub(super) fn decay(&self, device: usize, time: f64) -> R {
        if self.lagged { exp(self.devices[device].lag * R::splat(-time)) } else { R::splat(0.0) }
    }

    /// Evaluates the parameters of all devices at these currents.
    #[inline(always)]
    pub(super) fn set_currents(&mut self, current: &[R]) {
        if self.follows {
            for (device, &current) in current.iter().enumerate() {
                self.set_current(device, current);
            }
        }
    }

    /// Evaluates the parameters of a device at its current.
    #[inline(always)]
    pub(super) fn set_current(&mut self, device: usize, current: R) {
        R::out_of_line(SetCurrent { prediction: self, device, current });
    }

    /// Force of all dampers of a device, without its factor, at this motion; and the rates of their states.
    #[inline(always)]
    pub(super) fn force_of(&mut self, device: usize, states: &[M::State<R>], motion: Motion<R>) -> R {
        R::out_of_line(EvaluateForce { prediction: self, device, states, motion });
        self.force[device]
    }

    /// Moves the states of a device ahead by their rates: `to = from + step * rate`, from `to` itself by default.
    #[inline(always)]
    pub(super) fn move_states(
        &self,
        device: usize,
        step: f64,
        from: Option<&[M::State<R>]>,
        to: &mut [M::State<R>],
    ) {
        let own = &self.devices[device];
        for place in own.first..own.first + own.sides.len() {
            let start = from.map_or(to[place], |from| from[place]);
            to[place] = start.advance(R::splat(step), self.rates[place]);
        }
    }

    /// Evaluates the resisting forces at a motion, with the forces of the devices, and from them the accelerations.
    #[inline(always)]
    pub(super) fn accelerate(&mut self, displacement: &[R], velocity: &[R], ground: R) {
        let Self { building, resisting, force, acceleration, .. } = self;
        R::out_of_line(Accelerate {
            building,
            displacement,
            velocity,
            ground,
            force,
            resisting,
            acceleration,
        });
    }

    /// Evaluates forces, rates and accelerations at a moment, with the parameters of the present currents.
    #[inline(always)]
    pub(super) fn evaluate(&mut self, moment: &Moment<M, R>, ground: R) {
        for device in 0..self.devices.len() {
            let motion = Motion {
                displacement: self.building.devices.dot(device, &moment.displacement),
                velocity: self.building.devices.dot(device, &moment.velocity),
            };
            let force = self.force_of(device, &moment.states, motion);
            self.force[device] = force * self.scale[device];
        }
        self.accelerate(&moment.displacement, &moment.velocity, ground);
    }
}

// Each of these is called at several places: inlined there, the models would take long to compile.

struct SetCurrent<'a, 'b, M: DamperModel, R: Lanes> {
    prediction: &'a mut Prediction<'b, M, R>,
    device: usize,
    current: R,
}

impl<M: DamperModel, R: Lanes> OutOfLine for SetCurrent<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Prediction { laws, devices, .. } = self.prediction;
        let own = &mut devices[self.device];
        laws.follow(&own.columns, self.current, &mut own.values);
        for &parameter in &own.cancelled {
            own.values[parameter] = R::splat(0.0);
        }
        own.at.follow(&own.values, laws.follows());
    }
}

struct EvaluateForce<'a, 'b, M: DamperModel, R: Lanes> {
    prediction: &'a mut Prediction<'b, M, R>,
    device: usize,
    states: &'a [M::State<R>],
    motion: Motion<R>,
}

impl<M: DamperModel, R: Lanes> OutOfLine for EvaluateForce<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { prediction: Prediction { devices, rates, force, .. }, device, states, motion } = self;
        let own = &devices[device];
        let mut sum = R::splat(0.0);
        for (number, &[side, share]) in own.sides.iter().enumerate() {
            let state = states[own.first + number];
            let side = R::splat(side);
            let motion =
                Motion { displacement: motion.displacement * side, velocity: motion.velocity * side };
            sum = M::force(&own.at, state, motion).mul_add(R::splat(share), sum);
            if M::SPEC.n_states > 0 {
                rates[own.first + number] = M::rate(&own.at, state, motion);
            }
        }
        force[device] = sum;
    }
}

/// Accelerations of a building relative to the ground, without passive elements that yield.
struct Accelerate<'a, R> {
    building: &'a Building,
    displacement: &'a [R],
    velocity: &'a [R],
    ground: R,
    force: &'a [R],
    resisting: &'a mut [R],
    acceleration: &'a mut [R],
}

impl<R: Lanes> OutOfLine for Accelerate<'_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { building, ground, force, .. } = self;
        let n = building.n;
        // Slices of one length: pointers and bounds are read once, not in every product.
        let (displacement, velocity) = (&self.displacement[..n], &self.velocity[..n]);
        let (resisting, acceleration) = (&mut self.resisting[..n], &mut self.acceleration[..n]);
        for (coordinate, resisting) in resisting.iter_mut().enumerate() {
            let [sprung, damped] = building.springs.rows.coupling(coordinate, displacement, velocity);
            *resisting = sprung + damped;
        }
        for (device, &force) in force.iter().enumerate() {
            for &(coordinate, reach) in building.devices.row(device) {
                resisting[coordinate] = force.mul_add(R::splat(reach), resisting[coordinate]);
            }
        }
        building.accelerate(resisting, ground, acceleration);
    }
}

struct Prepare<'a, 'b, M: DamperModel, R: Lanes> {
    prediction: &'a mut Prediction<'b, M, R>,
}

impl<M: DamperModel, R: Lanes> OutOfLine for Prepare<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { prediction } = self;
        for index in 0..prediction.devices.len() {
            let own = &mut prediction.devices[index];
            prediction.laws.prepare(&mut own.columns);
            prediction.laws.evaluate(&own.columns, R::splat(0.0), &mut own.values);
            for &parameter in &own.cancelled {
                own.values[parameter] = R::splat(0.0);
            }
            own.at = M::Parameters::from_slice(&own.values);
        }
    }
}

/// A step of the model from a moment at which it was evaluated, to the next, where it is evaluated again.
///
/// The ground acceleration is given at the start, the middle and the end of the step; `decay` is the share of the
/// difference of current and command that is left after half of its `length` [s].
pub(super) struct Step<'a, 'b, M: DamperModel, R: Lanes> {
    pub(super) prediction: &'a mut Prediction<'b, M, R>,
    pub(super) scratch: &'a mut Scratch<M, R>,
    pub(super) moment: &'a mut Moment<M, R>,
    pub(super) length: f64,
    pub(super) command: &'a [R],
    pub(super) decay: &'a [R],
    pub(super) ground: &'a [R],
    /// Command of the next step, which acts on a driver without a lag at once.
    pub(super) next_command: &'a [R],
}

impl<M: DamperModel, R: Lanes> OutOfLine for Step<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { prediction, scratch, moment, length: step, command, decay, ground, next_command } = self;
        let Scratch { staged, next } = scratch;
        let n = moment.displacement.len();
        next.states.copy_from_slice(&moment.states);
        staged.velocity.copy_from_slice(&moment.velocity);
        let weights = [step / 6.0, step / 3.0, step / 3.0, step / 6.0];
        let reaches = [0.5 * step, 0.5 * step, step, 0.0];
        // The increments are h v + h^2 (a1 + a2 + a3)/6 and h (a1 + 2 a2 + 2 a3 + a4)/6.
        let square = R::splat(step * step / 6.0);
        for i in 0..n {
            next.displacement[i] = moment.velocity[i].mul_add(R::splat(step), moment.displacement[i]);
            next.velocity[i] = moment.velocity[i];
        }
        for stage in 0..STAGES {
            let (weight, reach) = (R::splat(weights[stage]), R::splat(reaches[stage]));
            let last = stage == STAGES - 1;
            for i in 0..n {
                let acceleration = prediction.acceleration[i];
                next.velocity[i] = acceleration.mul_add(weight, next.velocity[i]);
                if !last {
                    next.displacement[i] = acceleration.mul_add(square, next.displacement[i]);
                    staged.displacement[i] = staged.velocity[i].mul_add(reach, moment.displacement[i]);
                    staged.velocity[i] = acceleration.mul_add(reach, moment.velocity[i]);
                }
            }
            if M::SPEC.n_states > 0 {
                for (place, &rate) in prediction.rates.iter().enumerate() {
                    next.states[place] = next.states[place].advance(weight, rate);
                    staged.states[place] = moment.states[place].advance(reach, rate);
                }
            }
            if last {
                break;
            }
            if stage != 1 && prediction.lagged {
                // The currents in the middle of the step, then at its end.
                for (device, current) in moment.current.iter_mut().enumerate() {
                    *current = (*current - command[device]).mul_add(decay[device], command[device]);
                }
                prediction.set_currents(&moment.current);
            }
            prediction.evaluate(staged, ground[if stage == 2 { 2 } else { 1 }]);
        }
        moment.displacement.copy_from_slice(&next.displacement);
        moment.velocity.copy_from_slice(&next.velocity);
        moment.states.copy_from_slice(&next.states);
        if !prediction.lagged {
            moment.current.copy_from_slice(next_command);
            prediction.set_currents(&moment.current);
        }
        prediction.evaluate(moment, ground[2]);
    }
}
