//! The decisions of a rollout, and what it keeps from sample to sample.

use super::copy::{DamperCopy, Stretch};
use super::forecast::Forecast;
use super::prediction::{Moment, Prediction, Scratch, Step};
use super::{LEVELS, OTHER_TAILS, Timing};
use crate::building::Building;
use crate::control::loop_model::LoopModel;
use crate::control::{Gains, Measurement, within};
use crate::damper::model::DamperModel;
use crate::damper::{ModelVisitor, visit};
use crate::lanes::{Lanes, OutOfLine};
use crate::real::Real;

/// A tried command and the one that follows it: the base alone, then each level before each tail.
const TRIALS: usize = 1 + LEVELS * TAILS;
/// Longest horizon [s].
const LONGEST_HORIZON: f64 = 1.0;

/// A rollout of some model of the dampers: dispatched once a control sample, never within a time step.
pub(crate) trait Plan<R: Lanes> {
    /// Commands of a sample.
    fn command(&mut self, gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]);
}

/// The rollout of a loop before the first sample.
pub(crate) fn plan<'a, R: Lanes + 'a>(
    model: LoopModel<'a>,
    timing: Timing,
    gains: &Gains<'_, R>,
    ranges: &[[f64; 2]],
) -> Option<Box<dyn Plan<R> + 'a>> {
    visit(model.damper.spec().name, NewPlan { model, timing, gains, ranges })
}

struct NewPlan<'a, 'b, R: Lanes> {
    model: LoopModel<'a>,
    timing: Timing,
    gains: &'b Gains<'b, R>,
    ranges: &'b [[f64; 2]],
}

impl<'a, R: Lanes + 'a> ModelVisitor for NewPlan<'a, '_, R> {
    type Output = Box<dyn Plan<R> + 'a>;
    fn visit<M: DamperModel + 'static>(self) -> Self::Output {
        let prediction = Prediction::<M, R>::new(&self.model);
        let mut planner = None;
        R::out_of_line(NewPlanner { plan: self, prediction, planner: &mut planner });
        match planner {
            Some(planner) => planner,
            None => unreachable!("the work sets it"),
        }
    }
}

struct NewPlanner<'a, 'b, 'c, M: DamperModel, R: Lanes> {
    plan: NewPlan<'a, 'b, R>,
    prediction: Prediction<'a, M, R>,
    planner: &'c mut Option<Box<dyn Plan<R> + 'a>>,
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

/// Commands that follow a tried one: the base and the others.
const TAILS: usize = 1 + OTHER_TAILS;

impl<'a, M: DamperModel + 'a, R: Lanes + 'a> OutOfLine for NewPlanner<'a, '_, '_, M, R> {
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // limited before
    fn run(self) {
        let Self { plan: NewPlan { timing, gains, ranges, .. }, prediction, planner } = self;
        let n_devices = ranges.len();
        let mut tried = vec![R::splat(0.0); TRIALS * n_devices];
        let mut tails = tried.clone();
        for (device, &[smallest, largest]) in ranges.iter().enumerate() {
            let (smallest, largest) = (R::splat(smallest), R::splat(largest));
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
        let [order, forgetting, covariance] = numbers(&gains.tables[1]);
        let sample_time = timing.sample_time;
        *planner = Some(Box::new(Planner {
            copy: DamperCopy::new(
                &prediction,
                &timing,
                &tried[..n_devices],
                numbers(&gains.tables[2]),
                gains.of_loop(ACCELERATION_WEIGHT),
            ),
            forecast: Forecast::new(order as usize, forgetting, covariance, n_nodes),
            start: Moment::of(&prediction),
            trial: Moment::of(&prediction),
            scratch: Scratch::of(&prediction),
            held: tried[..n_devices].to_vec(),
            ground: vec![R::splat(0.0); 2 * n_steps + 1],
            on_way: (timing.delay_rest > 0.0).then(|| Stretch::new(&prediction, timing.delay_rest, step)),
            sample: Stretch::new(&prediction, sample_time, step),
            decision: Stretch::new(&prediction, timing.hold, step),
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

struct Planner<'a, M: DamperModel, R: Lanes> {
    prediction: Prediction<'a, M, R>,
    scratch: Scratch<M, R>,
    copy: DamperCopy<M, R>,
    forecast: Forecast<R>,
    timing: Timing,
    /// Time from a measurement until its command acts [s].
    delay: f64,
    on_way: Option<Stretch<R>>,
    sample: Stretch<R>,
    decision: Stretch<R>,
    /// Tried commands, shape (trials, devices), and those that follow them.
    tried: Vec<R>,
    tails: Vec<R>,
    /// Steps of the horizon of each lane, their inverse, the largest, and the steps at which a horizon ends.
    steps: R,
    per_steps: R,
    n_steps: usize,
    ends: Vec<bool>,
    /// The motion at the instant when the command acts, and that of a trial.
    start: Moment<M, R>,
    trial: Moment<M, R>,
    /// Forecast at the start, middle and end of each step.
    ground: Vec<R>,
    /// Squares of the largest drift and absolute acceleration so far.
    peaks: [R; 2],
    /// Largest ground acceleration so far, beyond which none is forecast.
    strongest: R,
    held: Vec<R>,
    number: usize,
}

impl<M: DamperModel, R: Lanes> Plan<R> for Planner<'_, M, R> {
    fn command(&mut self, gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        R::out_of_line(Decide { planner: self, gains, measured, command });
    }
}

struct Decide<'a, 'b, M: DamperModel, R: Lanes> {
    planner: &'a mut Planner<'b, M, R>,
    gains: &'a Gains<'a, R>,
    measured: &'a Measurement<'a, R>,
    command: &'a mut [R],
}

impl<M: DamperModel, R: Lanes> OutOfLine for Decide<'_, '_, M, R> {
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

/// Squares of drifts and absolute accelerations at an instant: sum and largest of each.
#[derive(Clone, Copy)]
struct Squares<R> {
    sums: [R; 2],
    largest: [R; 2],
}

/// Squares of drifts and accelerations, from accelerations of the coordinates relative to the ground.
#[inline(always)]
fn squares<R: Real>(building: &Building, displacement: &[R], acceleration: &[R], ground: R) -> Squares<R> {
    let zero = R::splat(0.0);
    let mut found = Squares { sums: [zero; 2], largest: [zero; 2] };
    for storey in 0..building.storeys.len() {
        let drift = building.storeys.dot(storey, displacement);
        found.sums[0] = drift.mul_add(drift, found.sums[0]);
        found.largest[0] = (drift * drift).max(found.largest[0]);
    }
    for floor in 0..building.floors.len() {
        let absolute = building.floors.add_dot(floor, acceleration, ground);
        found.sums[1] = absolute.mul_add(absolute, found.sums[1]);
        found.largest[1] = (absolute * absolute).max(found.largest[1]);
    }
    found
}

impl<M: DamperModel, R: Lanes> Planner<'_, M, R> {
    /// Takes the readings of a sample into the memory; returns zero, or not a number where a reading is not finite.
    #[inline(always)]
    fn observe(&mut self, gains: &Gains<'_, R>, measured: &Measurement<'_, R>, decides: bool) -> R {
        let zero = R::splat(0.0);
        let mut doubt = zero;
        for signal in
            [measured.displacement, measured.velocity, measured.deformation, measured.rate, measured.force]
        {
            for value in signal {
                doubt = value.mul_add(zero, doubt);
            }
        }
        let mut ground = zero;
        if self.forecast.measures() {
            ground = measured.ground_acceleration;
            doubt = ground.mul_add(zero, doubt);
            self.strongest = ground.abs().max(self.strongest);
        }
        let known = doubt.equal(doubt);
        self.copy.advance(&mut self.prediction, &self.timing, self.number, measured);
        self.copy.compare(&mut self.prediction, measured, gains.of_loop(FORCE_CORRECTION), decides);
        self.prediction.force.copy_from_slice(measured.force);
        self.prediction.accelerate(measured.displacement, measured.velocity, ground);
        let now =
            squares(self.prediction.building, measured.displacement, &self.prediction.acceleration, ground);
        for (peak, largest) in self.peaks.iter_mut().zip(now.largest) {
            *peak = R::select(known, largest, zero).max(*peak);
        }
        if decides {
            self.forecast.learn(measured.ground_acceleration, self.strongest);
            self.forecast.predict(self.strongest, self.timing.hold, &measured.preview);
        }
        doubt
    }

    /// Predicts the motion at the instant when the command will act, with the commands that are on their way.
    #[inline(always)]
    fn foresee(&mut self, measured: &Measurement<'_, R>) {
        let Self { prediction, scratch, copy, forecast, timing, start, number, .. } = self;
        start.displacement.copy_from_slice(measured.displacement);
        start.velocity.copy_from_slice(measured.velocity);
        start.current.copy_from_slice(&copy.current);
        start.states.copy_from_slice(&copy.states);
        if *number > 0 {
            let first = usize::from(self.on_way.is_none());
            let mut time = 0.0;
            for piece in first..=timing.delay_samples {
                let stretch = match (&self.on_way, piece) {
                    (Some(on_way), 0) => on_way,
                    _ => &self.sample,
                };
                let command = copy.sent_at(*number + piece, timing.delay_samples + 1);
                if !prediction.lagged {
                    start.current.copy_from_slice(command);
                }
                prediction.set_currents(&start.current);
                prediction.evaluate(start, forecast.at(time / timing.hold));
                let step = stretch.step();
                for _ in 0..stretch.steps {
                    let ground = [0.0, 0.5, 1.0].map(|share| step.mul_add(share, time) / timing.hold);
                    let ground = [forecast.at(ground[0]), forecast.at(ground[1]), forecast.at(ground[2])];
                    R::out_of_line(Step {
                        prediction: &mut *prediction,
                        scratch: &mut *scratch,
                        moment: &mut *start,
                        length: step,
                        command,
                        decay: &stretch.decay,
                        ground: &ground,
                        next_command: command,
                    });
                    time += step;
                }
            }
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
        let Self { prediction, scratch, trial: moment, tried, tails, timing, .. } = self;
        let n_devices = self.held.len();
        let tried = &tried[trial * n_devices..][..n_devices];
        let tail = &tails[trial * n_devices..][..n_devices];
        let held_at = |step: usize| if step < timing.steps as usize { tried } else { tail };
        moment.copy_from(&self.start);
        if !prediction.lagged {
            moment.current.copy_from_slice(tried);
        }
        prediction.set_currents(&moment.current);
        prediction.evaluate(moment, self.ground[0]);
        let zero = R::splat(0.0);
        let mut sums = [zero; 2];
        let mut peaks = self.peaks;
        let mut energy = zero;
        for step in 0..self.n_steps {
            R::out_of_line(Step {
                prediction: &mut *prediction,
                scratch: &mut *scratch,
                moment: &mut *moment,
                length: timing.step(),
                command: held_at(step),
                decay: &self.decision.decay,
                ground: &self.ground[2 * step..2 * step + 3],
                next_command: held_at(step + 1),
            });
            let number = R::splat(count(step + 1));
            let now = squares(
                prediction.building,
                &moment.displacement,
                &prediction.acceleration,
                self.ground[2 * step + 2],
            );
            // Lanes whose horizon has ended wait for the others.
            let over = self.steps.less(number);
            for kind in 0..sums.len() {
                sums[kind] = sums[kind] + R::select(over, zero, now.sums[kind]);
                peaks[kind] = R::select(over, zero, now.largest[kind]).max(peaks[kind]);
            }
            if self.ends[step + 1] {
                let twice = twice_energy(prediction.building, &moment.displacement, &moment.velocity);
                energy = R::select(self.steps.equal(number), twice, energy);
            }
        }
        let weights = [gains.of_loop(DRIFT_WEIGHT), gains.of_loop(ACCELERATION_WEIGHT)];
        let mut mean = zero;
        let mut peak = zero;
        for kind in 0..weights.len() {
            mean = sums[kind].mul_add(weights[kind], mean);
            peak = peaks[kind].mul_add(weights[kind], peak);
        }
        let running = mean.mul_add(self.per_steps, peak * gains.of_loop(PEAK_WEIGHT));
        energy.mul_add(gains.of_loop(ENERGY_WEIGHT), running)
    }
}

/// q'K q + q''M q' [J].
#[inline(always)]
fn twice_energy<R: Real>(building: &Building, displacement: &[R], velocity: &[R]) -> R {
    let mut sum = R::splat(0.0);
    for coordinate in 0..building.n {
        sum = building.springs.rows.sprung(coordinate, displacement).mul_add(displacement[coordinate], sum);
        sum = building.mass.dot(coordinate, velocity).mul_add(velocity[coordinate], sum);
    }
    sum
}
