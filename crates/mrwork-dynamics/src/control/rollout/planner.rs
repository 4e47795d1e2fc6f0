//! The decisions of a rollout, and what it keeps from sample to sample.

pub(super) mod recorded;

use super::copy::{DamperCopy, Stretch};
use super::forecast::Forecast;
use super::prediction::{Moment, Prediction, devices};
use super::storeys::Storeys;
use super::timing::Timing;
use crate::building::Building;
use crate::control::loop_model::LoopModel;
use crate::control::measurement::Measurement;
use crate::control::spec::Gains;
use crate::coupled::{DeviceState, Devices};
use crate::lanes::Lanes;
use crate::real::{OutOfLine, Real, within};

/// Commands that are tried beside the base alone.
pub(in crate::control) const LEVELS: usize = 5;
/// Commands that follow them in the prediction, beside the base.
pub(in crate::control) const OTHER_TAILS: usize = 2;
/// A tried command and the one that follows it: the base alone, then each level before each tail.
const TRIALS: usize = 1 + LEVELS * TAILS;
/// Longest horizon [s].
const LONGEST_HORIZON: f64 = 1.0;

/// The rollout of a loop before the first sample; `None` for a model of dampers that is not registered.
pub(crate) fn plan<'a, R: Lanes + 'a>(
    model: &LoopModel<'a>,
    timing: Timing,
    gains: &Gains<'_, R>,
    ranges: &[[f64; 2]],
) -> Option<Box<Planner<'a, R>>> {
    let (prediction, copied) = (Prediction::of(model)?, devices(model)?);
    let mut planner = None;
    R::out_of_line(NewPlanner { timing, gains, ranges, prediction, copied, planner: &mut planner });
    planner
}

struct NewPlanner<'a, 'b, R: Lanes> {
    timing: Timing,
    gains: &'b Gains<'b, R>,
    ranges: &'b [[f64; 2]],
    prediction: Prediction<'a, R>,
    copied: Box<dyn Devices<R> + 'a>,
    planner: &'b mut Option<Box<Planner<'a, R>>>,
}

/// Places of the gains in the spec.
const BASE: usize = 0;
const OF_TAILS: usize = 1;
const OF_LEVELS: usize = 2;
const DRIFT_WEIGHT: usize = 3;
const ACCELERATION_WEIGHT: usize = 4;
const PEAK_WEIGHT: usize = 5;
const ENERGY_WEIGHT: usize = 6;
const HORIZON: usize = 7;
const FORCE_CORRECTION: usize = 8;
const RESIDUAL_WEIGHT: usize = 9;

/// Commands that follow a tried one: the base and the others.
const TAILS: usize = 1 + OTHER_TAILS;

impl<'a, R: Lanes + 'a> OutOfLine for NewPlanner<'a, '_, R> {
    type Home = Self;
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // limited before
    fn run(self) {
        let Self { timing, gains, ranges, prediction, copied, planner } = self;
        let n_devices = ranges.len();
        let mut tried = vec![R::splat(0.0); TRIALS * n_devices];
        let mut tails = tried.clone();
        for (device, &[smallest, largest]) in ranges.iter().enumerate() {
            let (smallest, largest) = (R::splat(smallest), R::splat(largest));
            if device >= gains.sizes.n_devices {
                // It holds its command.
                for place in (device..tried.len()).step_by(n_devices) {
                    (tried[place], tails[place]) = (smallest, smallest);
                }
                continue;
            }
            let base = within(gains.of_device(BASE, device), smallest, largest);
            tried[device] = base;
            tails[device] = base;
            let others = gains.numbers(OF_TAILS, device);
            for (number, &level) in gains.numbers(OF_LEVELS, device).iter().enumerate() {
                for tail in 0..TAILS {
                    let place = (1 + number * TAILS + tail) * n_devices + device;
                    tried[place] = within(level, smallest, largest);
                    tails[place] = if tail == 0 { base } else { within(others[tail - 1], smallest, largest) };
                }
            }
        }
        let step = timing.step();
        let longest = LONGEST_HORIZON.max(timing.hold);
        let horizon = within(gains.of_loop(HORIZON), R::splat(timing.hold), R::splat(longest));
        let steps = (horizon / R::splat(step)).round_ties_even();
        let mut n_steps = timing.steps as usize;
        steps.for_each(|_, steps| n_steps = n_steps.max(steps as usize));
        let mut ends = vec![false; n_steps + 1];
        steps.for_each(|_, steps| ends[steps as usize] = true);
        let delay = timing.sample_time.mul_add(count(timing.delay_samples), timing.delay_rest);
        let n_nodes = ((delay + count(n_steps) * step) / timing.hold).ceil() as usize + 2;
        let n_elements = prediction.building().n_elements();
        let [order, forgetting, covariance] = numbers(&gains.tables[1]);
        let sample_time = timing.sample_time;
        *planner = Some(Box::new(Planner {
            copy: DamperCopy::new(
                copied,
                &timing,
                &tried[..n_devices],
                numbers(&gains.tables[2]),
                gains.of_loop(ACCELERATION_WEIGHT),
            ),
            forecast: Forecast::new(order as usize, forgetting, covariance, n_nodes),
            start: Moment {
                displacement: prediction.displacement().to_vec(),
                velocity: vec![R::splat(0.0); prediction.building().n_coordinates()],
                devices: DeviceState::default(),
                loops: vec![R::splat(0.0); n_elements],
            },
            storeys: Storeys::new(prediction.building(), &gains.tables[3], sample_time),
            held: tried[..n_devices].to_vec(),
            ground: vec![R::splat(0.0); 2 * n_steps + 1],
            on_way: (timing.delay_rest > 0.0).then(|| Stretch::new(timing.delay_rest, step)),
            sample: Stretch::new(sample_time, step),
            peaks: [R::splat(0.0); 2],
            strongest: R::splat(0.0),
            per_steps: R::splat(1.0) / steps,
            number: 0,
            tried,
            tails,
            steps,
            n_steps,
            ends,
            delay,
            timing,
            prediction,
        }));
    }
}

#[allow(clippy::cast_precision_loss)] // small counts
fn count(number: usize) -> f64 {
    number as f64
}

/// Numbers of a table, which was checked.
fn numbers<const N: usize>(table: &[f64]) -> [f64; N] {
    core::array::from_fn(|place| table.get(place).copied().unwrap_or(f64::NAN))
}

/// What a rollout keeps from sample to sample.
pub(crate) struct Planner<'a, R: Lanes> {
    prediction: Prediction<'a, R>,
    copy: DamperCopy<'a, R>,
    forecast: Forecast<R>,
    timing: Timing,
    /// Time from a measurement until its command acts [s].
    delay: f64,
    on_way: Option<Stretch>,
    sample: Stretch,
    /// Tried commands, shape (trials, devices), and those that follow them.
    tried: Vec<R>,
    tails: Vec<R>,
    /// Steps of the horizon of each lane, their inverse, the largest, and the steps at which a horizon ends.
    steps: R,
    per_steps: R,
    n_steps: usize,
    ends: Vec<bool>,
    /// The motion at the instant when the command acts.
    start: Moment<R>,
    /// Forecast at the start, middle and end of each step.
    ground: Vec<R>,
    /// Squares of the largest drift and absolute acceleration so far.
    peaks: [R; 2],
    storeys: Storeys<R>,
    /// Largest ground acceleration so far, beyond which none is forecast.
    strongest: R,
    held: Vec<R>,
    number: usize,
}

impl<R: Lanes> Planner<'_, R> {
    /// Commands of a sample.
    pub(crate) fn command(&mut self, gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        R::out_of_line(Decide { planner: self, gains, measured, command });
    }
}

struct Decide<'a, 'b, R: Lanes> {
    planner: &'a mut Planner<'b, R>,
    gains: &'a Gains<'a, R>,
    measured: &'a Measurement<'a, R>,
    command: &'a mut [R],
}

impl<R: Lanes> OutOfLine for Decide<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { planner, gains, measured, command } = self;
        let decides = planner.number.is_multiple_of(planner.timing.samples);
        let doubt = planner.observe(gains, measured, decides);
        if decides {
            planner.foresee(measured);
            planner.choose(gains);
        }
        for (command, &held) in command.iter_mut().zip(&planner.held) {
            *command = held + doubt;
        }
        planner.number += 1;
    }
}

/// What a prediction has found to its horizon: sums and largest squares, twice the energy and the square of what is left
/// of drifts there.
struct Costs<R> {
    sums: [R; 2],
    peaks: [R; 2],
    energy: R,
    left: R,
}

/// Squares of drifts and absolute accelerations at an instant: sum and largest of each.
#[derive(Clone, Copy)]
struct Squares<R> {
    sums: [R; 2],
    largest: [R; 2],
}

/// Squares of drifts and of the absolute accelerations of the floors.
#[inline(always)]
fn squares<R: Real>(building: &Building, displacement: &[R], absolute: impl Fn(usize) -> R) -> Squares<R> {
    let zero = R::splat(0.0);
    let mut found = Squares { sums: [zero; 2], largest: [zero; 2] };
    for storey in 0..building.storeys.len() {
        let drift = building.storeys.dot(storey, displacement);
        found.sums[0] = drift.mul_add(drift, found.sums[0]);
        found.largest[0] = (drift * drift).max(found.largest[0]);
    }
    for floor in 0..building.floors.len() {
        let absolute = absolute(floor);
        found.sums[1] = absolute.mul_add(absolute, found.sums[1]);
        found.largest[1] = (absolute * absolute).max(found.largest[1]);
    }
    found
}

/// The same of the model, as evaluated last under this ground acceleration.
#[inline(always)]
fn squares_of<R: Lanes>(prediction: &Prediction<'_, R>, ground: R) -> Squares<R> {
    let (building, acceleration) = (prediction.building(), prediction.acceleration());
    squares(building, prediction.displacement(), |floor| building.floors.add_dot(floor, acceleration, ground))
}

impl<R: Lanes> Planner<'_, R> {
    /// Takes the readings of a sample into the memory; returns zero, or not a number where a reading is not finite.
    #[inline(always)]
    fn observe(&mut self, gains: &Gains<'_, R>, measured: &Measurement<'_, R>, decides: bool) -> R {
        let doubt = self.read(measured);
        let known = doubt.equal(doubt);
        self.copy.advance(&self.timing, self.number, measured.sent);
        let first = self.number == 0;
        self.storeys.follow(&mut self.prediction, measured.displacement, known, first);
        self.compare(gains, measured, known, decides);
        if decides {
            self.forecast.learn(measured.ground_acceleration, self.strongest);
            self.forecast.predict(self.strongest, self.timing.hold, &measured.preview);
        }
        doubt
    }

    /// The acceleration of the ground, where it is measured.
    #[inline(always)]
    fn shaking(&self, measured: &Measurement<'_, R>) -> R {
        if self.forecast.measures() { measured.ground_acceleration } else { R::splat(0.0) }
    }

    /// Takes the readings of the dampers; returns zero, or not a number where a reading is not finite.
    #[inline(always)]
    fn read(&mut self, measured: &Measurement<'_, R>) -> R {
        let zero = R::splat(0.0);
        let mut doubt = zero;
        for signal in
            [measured.displacement, measured.velocity, measured.deformation, measured.rate, measured.force]
        {
            for value in signal {
                doubt = value.mul_add(zero, doubt);
            }
        }
        if self.storeys.measured {
            for value in measured.acceleration {
                doubt = value.mul_add(zero, doubt);
            }
        }
        if self.forecast.measures() {
            let ground = self.shaking(measured);
            doubt = ground.mul_add(zero, doubt);
            self.strongest = ground.abs().max(self.strongest);
        }
        self.copy.read(measured);
        doubt
    }

    /// Compares the measured forces and accelerations with those of the model, and keeps the peaks.
    #[inline(always)]
    fn compare(
        &mut self,
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        known: R::Mask,
        decides: bool,
    ) {
        let ground = self.shaking(measured);
        let factors = decides.then(|| self.prediction.scale());
        self.copy.compare(measured, gains.of_loop(FORCE_CORRECTION), factors);
        let Measurement { displacement, velocity, force, acceleration, .. } = *measured;
        self.prediction.accelerate([displacement, velocity, &self.storeys.loops], force, &ground);
        let now = if self.storeys.measured {
            squares(self.prediction.building(), displacement, |floor| acceleration[floor])
        } else {
            squares_of(&self.prediction, ground)
        };
        for (peak, largest) in self.peaks.iter_mut().zip(now.largest) {
            *peak = R::select(known, largest, R::splat(0.0)).max(*peak);
        }
        self.storeys.compare(&mut self.prediction, acceleration, ground, known, decides);
    }

    /// Predicts the motion at the instant when the command will act, with the commands that are on their way.
    #[inline(always)]
    fn foresee(&mut self, measured: &Measurement<'_, R>) {
        let Self { prediction, copy, forecast, timing, start, number, storeys, .. } = self;
        start.loops.copy_from_slice(&storeys.loops);
        start.displacement.copy_from_slice(measured.displacement);
        start.velocity.copy_from_slice(measured.velocity);
        copy.save(&mut start.devices);
        if *number > 0 {
            let first = usize::from(self.on_way.is_none());
            let mut time = 0.0;
            prediction.begin(start, self.sample.step());
            for piece in first..=timing.delay_samples {
                let stretch = match (self.on_way, piece) {
                    (Some(on_way), 0) => on_way,
                    _ => self.sample,
                };
                let command = copy.sent_at(*number + piece, timing.delay_samples + 1);
                let step = stretch.step();
                prediction.set_step(step);
                for _ in 0..stretch.steps {
                    prediction.evaluate(command, &forecast.at(time / timing.hold));
                    let middle = forecast.at(step.mul_add(0.5, time) / timing.hold);
                    time += step;
                    prediction.advance(&middle, &forecast.at(time / timing.hold));
                }
            }
            prediction.save(start);
        }
        for (place, ground) in self.ground.iter_mut().enumerate() {
            let time = (0.5 * timing.step()).mul_add(count(place), self.delay);
            *ground = forecast.at(time / timing.hold);
        }
    }

    /// Tries every command, and holds the one of least cost; the base where none costs less.
    #[inline(always)]
    fn choose(&mut self, gains: &Gains<'_, R>) {
        let n_devices = self.held.len();
        let mut least = R::splat(0.0);
        for trial in 0..TRIALS {
            let cost = self.cost(gains, trial);
            let command = &self.tried[trial * n_devices..][..n_devices];
            if trial == 0 {
                least = cost;
                self.held.copy_from_slice(command);
            } else {
                let better = cost.less(least);
                least = R::select(better, cost, least);
                for (held, &command) in self.held.iter_mut().zip(command) {
                    *held = R::select(better, command, *held);
                }
            }
        }
    }

    /// Cost of a command that is held for a decision and followed by its tail.
    #[inline(always)]
    fn cost(&mut self, gains: &Gains<'_, R>, trial: usize) -> R {
        let Self { prediction, start, tried, tails, timing, .. } = self;
        let n_devices = self.held.len();
        let tried = &tried[trial * n_devices..][..n_devices];
        let tail = &tails[trial * n_devices..][..n_devices];
        prediction.begin(start, timing.step());
        prediction.evaluate(tried, &self.ground[0]);
        let zero = R::splat(0.0);
        let mut sums = [zero; 2];
        let mut peaks = self.peaks;
        let [mut energy, mut left] = [zero; 2];
        for step in 0..self.n_steps {
            let [middle, end] = [self.ground[2 * step + 1], self.ground[2 * step + 2]];
            prediction.advance(&middle, &end);
            let held = if step + 1 < timing.steps as usize { tried } else { tail };
            prediction.evaluate(held, &end);
            let number = R::splat(count(step + 1));
            let now = squares_of(prediction, end);
            // Lanes whose horizon has ended wait for the others.
            let over = self.steps.less(number);
            for kind in 0..sums.len() {
                sums[kind] = sums[kind] + R::select(over, zero, now.sums[kind]);
                peaks[kind] = R::select(over, zero, now.largest[kind]).max(peaks[kind]);
            }
            if self.ends[step + 1] {
                let ends = self.steps.equal(number);
                energy = R::select(ends, prediction.twice_energy(), energy);
                left = R::select(ends, prediction.left_squared(), left);
            }
        }
        self.sum(gains, Costs { sums, peaks, energy, left })
    }

    /// The cost of what a prediction has found.
    #[inline(always)]
    fn sum(&self, gains: &Gains<'_, R>, Costs { sums, peaks, energy, left }: Costs<R>) -> R {
        let weights = [gains.of_loop(DRIFT_WEIGHT), gains.of_loop(ACCELERATION_WEIGHT)];
        let [mut mean, mut peak] = [R::splat(0.0); 2];
        for kind in 0..weights.len() {
            mean = sums[kind].mul_add(weights[kind], mean);
            peak = peaks[kind].mul_add(weights[kind], peak);
        }
        let running = mean.mul_add(self.per_steps, peak * gains.of_loop(PEAK_WEIGHT));
        let cost = energy.mul_add(gains.of_loop(ENERGY_WEIGHT), running);
        left.mul_add(gains.of_loop(RESIDUAL_WEIGHT), cost)
    }
}
