//! One control sample: measurement, state estimate, command.

use super::batch::{Batch, BlockSample, OutsideLaw};
use super::directions::Directions;
use super::hardware::{Channel, Observer, Sensor};
use super::noise::normal;
use super::own_law::OwnState;
use crate::control::{
    Beginning, ForceCurve, Gains, LoopSizes, Measurement, Memory, Preview, ground_reach, plan,
};
use crate::coupled::{PlantMotion, mountings};
use crate::lanes::Lanes;
use crate::real::{OutOfLine, within};

/// State of the controller between two samples, for a block of lanes.
pub(super) struct Controller<'a, R: Lanes> {
    pub(super) columns: Vec<R>,
    reads_acceleration: bool,
    /// Zero; not a number in lanes where a gain is not a number.
    unknown: R,
    curves: Vec<ForceCurve<R>>,
    ground_reach: Vec<f64>,
    largest: Vec<f64>,
    /// Damper velocity below which the command is zero [m/s].
    dead_zone: R,
    /// Largest change of the command from sample to sample.
    pub(super) furthest: R,
    pub(super) memory: Memory<'a, R>,
    /// A law of the user.
    pub(super) own: Option<OwnState<'a, R>>,
    /// State estimate of the observer.
    pub(super) state: Vec<R>,
    /// Velocities relative to the ground of an estimate with absolute ones.
    pub(super) relative: Vec<R>,
    next_state: Vec<R>,
    pub(super) acceleration: Vec<R>,
    innovation: Vec<R>,
    pub(super) deformation: Vec<R>,
    pub(super) rate: Vec<R>,
    pub(super) force: Vec<R>,
    pub(super) ground_acceleration: R,
    /// Of the measured storeys.
    pub(super) drift: Vec<R>,
    /// Commands of the last `depth` samples, a ring buffer.
    pub(super) sent: Vec<R>,
    /// Number of samples in `sent`.
    pub(super) depth: usize,
    raw: Vec<R>,
    /// Above zero in lanes where a command was not a number.
    pub(super) command_invalid: R,
}

impl<'a, R: Lanes + 'a> Controller<'a, R> {
    /// The controller before the first sample.
    pub(super) fn new(batch: &Batch<'a>, runs: &[usize], directions: Option<Directions<'_>>) -> Self {
        let Batch { building, gains, tables, dampers, ranges, hardware, law, .. } = *batch;
        let sizes = batch.sizes();
        let LoopSizes { n_states, .. } = sizes;
        let n_devices = batch.n_devices();
        let n_gains = law.spec().n_gains(sizes);
        let last = runs.len() - 1;
        let columns: Vec<R> = (0..n_gains)
            .map(|column| {
                let value = |lane: usize| {
                    gains[batch.runs[runs[lane.min(last)]].candidate as usize * n_gains + column]
                };
                let change = |lane: usize, k| {
                    directions.map_or(0.0, |all| all.change(batch, runs[lane.min(last)], column, k))
                };
                R::from_fn(value).with_slopes(change)
            })
            .collect();
        let mut unknown = R::splat(0.0);
        for &column in &columns {
            unknown = R::select(column.equal(column), unknown, column);
        }
        let largest: Vec<f64> = ranges.iter().map(|&[_, largest]| largest).collect();
        let curves = match (law.spec().needs_curve, &batch.curve) {
            (true, Some(model)) => largest
                .iter()
                .zip(mountings(dampers))
                .take(batch.n_commanded)
                .map(|(&largest, place)| model.curve(largest, place))
                .collect(),
            _ => Vec::new(),
        };
        let shaping = |lane: usize| batch.shaping_of(batch.runs[runs[lane.min(last)]].candidate as usize);
        // The batch was checked: a law that predicts the motion has its model.
        let plan = if const { R::HAS_DERIVATIVES } {
            None
        } else {
            batch.timing().ok().flatten().and_then(|(model, timing)| {
                let gains = Gains { spec: law.spec(), columns: &columns, tables, sizes };
                plan(&model, timing, &gains, ranges)
            })
        };
        let delay = runs.iter().map(|&run| batch.delay_of(run)).max().unwrap_or(0);
        let depth = delay / hardware.steps as usize + 2;
        let zero = R::splat(0.0);
        let n_drifts = hardware.measured_storeys.len();
        let n_measured = batch
            .observer
            .map_or(0, |observer| observer.accelerations.len() + observer.deformations.len() + n_drifts);
        Self {
            columns,
            reads_acceleration: batch.reads_acceleration(),
            unknown,
            curves,
            ground_reach: ground_reach(&building.absolute, &building.influence),
            largest,
            dead_zone: R::from_fn(|lane| shaping(lane).dead_zone),
            furthest: R::from_fn(|lane| {
                hardware.command_rate.min(shaping(lane).slope) * hardware.sample_time
            }),
            memory: law.start(Beginning { n_devices: batch.n_commanded, plan }),
            own: batch
                .own
                .map(|own| OwnState::new(own, |lane| batch.runs[runs[lane.min(last)]].candidate as usize)),
            state: vec![zero; n_states],
            relative: vec![zero; building.n_coordinates()],
            next_state: vec![zero; n_states],
            acceleration: vec![zero; building.n_floors()],
            innovation: vec![zero; n_measured],
            deformation: vec![zero; n_devices],
            rate: vec![zero; n_devices],
            force: vec![zero; n_devices],
            ground_acceleration: zero,
            drift: vec![zero; n_drifts],
            sent: vec![zero; depth * n_devices],
            depth,
            raw: vec![zero; batch.n_commanded],
            command_invalid: zero,
        }
    }
}

impl<R: Lanes> Controller<'_, R> {
    /// Takes the velocity of the ground from an estimate with absolute velocities.
    #[inline(always)]
    pub(super) fn relate(&mut self, observer: Option<&Observer>, influence: &[f64], ground_velocity: R) {
        if observer.is_some_and(|observer| observer.is_absolute) {
            let absolute = &self.state[influence.len()..];
            for ((relative, &rate), &share) in self.relative.iter_mut().zip(absolute).zip(influence) {
                *relative = ground_velocity.mul_add(R::splat(-share), rate);
            }
        }
    }

    /// Commands of a sample.
    #[inline(always)]
    pub(super) fn sent_at(&self, sample: usize) -> &[R] {
        let n_devices = self.force.len();
        &self.sent[(sample % self.depth) * n_devices..][..n_devices]
    }
}

/// Displacements and velocities for the law: the estimate if there is an observer, else the true ones.
///
/// `relative` are the velocities of an estimate that has absolute ones.
#[inline(always)]
pub(super) fn known_state<'a, R>(
    observer: Option<&Observer>,
    [estimate, relative]: [&'a [R]; 2],
    displacement: &'a [R],
    velocity: &'a [R],
) -> (&'a [R], &'a [R]) {
    let (estimated, rates) = estimate.split_at(displacement.len());
    match observer {
        Some(observer) if observer.is_absolute => (estimated, relative),
        Some(_) => (estimated, rates),
        None => (displacement, velocity),
    }
}

/// Commands of a law outside of the core.
#[inline(always)]
fn ask<R: Lanes>(
    outside: &dyn OutsideLaw,
    runs: &[usize],
    number: usize,
    measured: &Measurement<'_, R>,
    commands: &mut [R],
) {
    let n_devices = commands.len();
    let mut raw = vec![f64::NAN; runs.len() * n_devices];
    outside.command(
        &BlockSample {
            runs,
            number,
            displacement: &by_run(measured.displacement, runs.len()),
            velocity: &by_run(measured.velocity, runs.len()),
            deformation: &by_run(measured.deformation, runs.len()),
            rate: &by_run(measured.rate, runs.len()),
            force: &by_run(measured.force, runs.len()),
            acceleration: &by_run(measured.acceleration, runs.len()),
            ground_acceleration: &by_run(&[measured.ground_acceleration], runs.len()),
            ground_velocity: &by_run(&[measured.ground_velocity], runs.len()),
            drift: &by_run(measured.drift, runs.len()),
        },
        &mut raw,
    );
    let last = runs.len() - 1;
    for (device, command) in commands.iter_mut().enumerate() {
        *command = R::from_fn(|lane| raw[lane.min(last) * n_devices + device]);
    }
}

/// A row for each run, from the lanes of each signal.
#[inline(always)]
fn by_run<R: Lanes>(signals: &[R], n_runs: usize) -> Vec<f64> {
    let mut rows = vec![0.0; n_runs * signals.len()];
    for (column, signal) in signals.iter().enumerate() {
        signal.for_each(|lane, value| {
            if lane < n_runs {
                rows[lane * signals.len() + column] = value;
            }
        });
    }
    rows
}

/// Motion and forces of the building at a sample, and the controller that measures them.
pub(super) struct Sample<'a, 'b, R: Lanes> {
    pub(super) batch: &'a Batch<'b>,
    pub(super) runs: &'a [usize],
    pub(super) streams: &'a [u64],
    pub(super) number: usize,
    pub(super) motion: PlantMotion<'a, R>,
    pub(super) force: &'a [R],
    pub(super) ground_acceleration: &'a R,
    /// As its sensor takes it.
    pub(super) ground_reading: &'a R,
    pub(super) ground_velocity: &'a R,
    /// In the state that laws read, see [`Measurement::state_ground`].
    pub(super) state_ground: Option<R>,
    pub(super) preview: Preview<'a>,
    pub(super) controller: &'a mut Controller<'b, R>,
}

impl<R: Lanes> OutOfLine for Sample<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(mut self) {
        self.measure();
        self.command();
        if let Some(observer) = self.batch.observer {
            self.estimate(observer);
        }
    }
}

impl<R: Lanes> Sample<'_, '_, R> {
    #[inline(always)]
    fn measure(&mut self) {
        let Batch { building, hardware, observer, .. } = *self.batch;
        let every = self.controller.reads_acceleration;
        for floor in 0..building.n_floors() {
            if every || observer.is_some_and(|observer| observer.accelerations.contains(&floor)) {
                let value =
                    building.floors.add_dot(floor, self.motion.acceleration, *self.ground_acceleration);
                let before = self.controller.acceleration[floor];
                self.controller.acceleration[floor] =
                    self.reading(Channel::Acceleration(floor), hardware.acceleration, value, before);
            }
        }
        self.controller.relate(observer, &building.influence, *self.ground_velocity);
        let before = self.controller.ground_acceleration;
        self.controller.ground_acceleration = self.reading(
            Channel::GroundAcceleration,
            hardware.ground_acceleration,
            *self.ground_reading,
            before,
        );
        for (place, &storey) in hardware.measured_storeys.iter().enumerate() {
            let value = building.storeys.dot(storey, self.motion.displacement);
            let before = self.controller.drift[place];
            self.controller.drift[place] =
                self.reading(Channel::Drift(storey), hardware.drift, value, before);
        }
        for device in 0..self.force.len() {
            let value = building.devices.dot(device, self.motion.displacement);
            let before = self.controller.deformation[device];
            self.controller.deformation[device] =
                self.reading(Channel::Deformation(device), hardware.deformation, value, before);
            let before = self.controller.force[device];
            self.controller.force[device] =
                self.reading(Channel::Force(device), hardware.force, self.force[device], before);
            let estimate = [&*self.controller.state, &*self.controller.relative];
            let (_, velocity) =
                known_state(observer, estimate, self.motion.displacement, self.motion.velocity);
            self.controller.rate[device] = building.devices.dot(device, velocity);
        }
    }

    /// Reading of a sensor: noise, resolution, faults.
    #[inline(always)]
    fn reading(&self, channel: Channel, sensor: Sensor, value: R, before: R) -> R {
        let mut reading = value;
        if sensor.noise > 0.0 {
            let (number, sample) = (channel.number(), self.number as u64);
            let noise = R::from_fn(|lane| normal(self.streams[lane], number, sample));
            reading = noise.mul_add(R::splat(sensor.noise), reading);
        }
        if sensor.resolution > 0.0 {
            let steps = (reading / R::splat(sensor.resolution)).round_ties_even();
            reading = steps * R::splat(sensor.resolution);
        }
        self.with_faults(channel, reading, before)
    }

    /// A signal after the faults of its channel.
    #[inline(always)]
    fn with_faults(&self, channel: Channel, value: R, before: R) -> R {
        let mut reading = value;
        for fault in &self.batch.hardware.faults {
            if fault.channel == channel && (fault.start..fault.end).contains(&self.number) {
                reading = match fault.value {
                    Some(value) => R::splat(value),
                    None => before,
                };
            }
        }
        reading
    }

    #[inline(always)]
    pub(super) fn command(&mut self) {
        let Batch { law, outside, tables, hardware, ranges, n_commanded, building, observer, .. } =
            *self.batch;
        let n_devices = self.force.len();
        let controller = &mut *self.controller;
        let earlier = (self.number.wrapping_sub(1) % controller.depth) * n_devices;
        let gains =
            Gains { spec: law.spec(), columns: &controller.columns, tables, sizes: self.batch.sizes() };
        let estimate = [&*controller.state, &*controller.relative];
        let (displacement, velocity) =
            known_state(observer, estimate, self.motion.displacement, self.motion.velocity);
        // A law that predicts the motion knows all dampers, any other those that it commands.
        let n_known = if law.spec().needs_model { n_devices } else { n_commanded };
        let measured = Measurement {
            displacement,
            velocity,
            deformation: &controller.deformation[..n_known],
            rate: &controller.rate[..n_known],
            force: &controller.force[..n_known],
            acceleration: &controller.acceleration,
            drift: &controller.drift,
            absolute: &building.absolute,
            has_sprung: &building.has_sprung,
            device_floors: building.device_floors.as_ref(),
            ground_acceleration: controller.ground_acceleration,
            ground_velocity: *self.ground_velocity,
            influence: &building.influence,
            state_ground: self.state_ground,
            preview: self.preview,
            ground_reach: &controller.ground_reach,
            largest: &controller.largest,
            curves: &controller.curves,
            sample_time: hardware.sample_time,
            sent: &controller.sent[earlier..earlier + n_known],
        };
        match (&mut controller.own, outside) {
            (Some(own), _) => own.command(&measured, self.number, &mut controller.raw),
            (None, Some(outside)) => ask(outside, self.runs, self.number, &measured, &mut controller.raw),
            (None, None) => controller.memory.command(&gains, &measured, &mut controller.raw),
        }
        let position = (self.number % self.controller.depth) * n_devices;
        for (device, &[held, _]) in ranges.iter().enumerate().skip(n_commanded) {
            let command = R::splat(held);
            self.controller.sent[position + device] =
                self.with_faults(Channel::Command(device), command, command);
        }
        for (device, &[smallest, largest]) in ranges[..n_commanded].iter().enumerate() {
            let raw = self.controller.raw[device];
            let checked = raw + self.controller.unknown;
            let known = checked.equal(checked);
            let invalid = R::select(known, R::splat(0.0), R::splat(1.0));
            self.controller.command_invalid = self.controller.command_invalid.max(invalid);
            let mut command =
                within(R::select(known, raw, R::splat(0.0)), R::splat(smallest), R::splat(largest));
            let slow = self.controller.rate[device].abs().less(self.controller.dead_zone);
            let none = within(R::splat(0.0), R::splat(smallest), R::splat(largest));
            command = R::select(slow, none, command);
            let mut before = command;
            if self.number > 0 {
                before = self.controller.sent[earlier + device];
                let furthest = self.controller.furthest;
                command = within(command, before - furthest, before + furthest);
            }
            self.controller.sent[position + device] =
                self.with_faults(Channel::Command(device), command, before);
        }
    }

    /// The state estimate for the next sample.
    #[inline(always)]
    pub(super) fn estimate(&mut self, observer: &Observer) {
        let Controller {
            state,
            next_state,
            acceleration,
            innovation,
            deformation,
            force,
            ground_acceleration,
            drift,
            ..
        } = &mut *self.controller;
        let (n_states, n_devices) = (state.len(), force.len());
        let finite = ground_acceleration.abs().less(R::splat(f64::INFINITY));
        let shaking = R::select(finite, *ground_acceleration, R::splat(0.0));
        let n_accelerations = observer.accelerations.len();
        let n_deformations = observer.deformations.len();
        for (row, innovation) in innovation.iter_mut().enumerate() {
            let measured = if row < n_accelerations {
                acceleration[observer.accelerations[row]]
            } else if row < n_accelerations + n_deformations {
                deformation[observer.deformations[row - n_accelerations]]
            } else {
                drift[row - n_accelerations - n_deformations]
            };
            let of_state = add_products(R::splat(0.0), &observer.output[row * n_states..], state);
            let mut expected = add_products(of_state, &observer.direct[row * n_devices..], force);
            if let Some(&direct) = observer.direct_ground.get(row) {
                expected = shaking.mul_add(R::splat(direct), expected);
            }
            let error = measured - expected;
            // A reading that is not finite is ignored.
            let finite = error.abs().less(R::splat(f64::INFINITY));
            *innovation = R::select(finite, error, R::splat(0.0));
        }
        let n_measured = innovation.len();
        for (row, next) in next_state.iter_mut().enumerate() {
            let mut sum = add_products(R::splat(0.0), &observer.transition[row * n_states..], state);
            for (device, &f) in force.iter().enumerate() {
                let finite = f.abs().less(R::splat(f64::INFINITY));
                let b = R::splat(observer.input[row * n_devices + device]);
                sum = R::select(finite, f, R::splat(0.0)).mul_add(b, sum);
            }
            if let Some(&moved) = observer.ground.get(row) {
                sum = shaking.mul_add(R::splat(moved), sum);
            }
            *next = add_products(sum, &observer.gain[row * n_measured..], innovation);
        }
        core::mem::swap(state, next_state);
    }
}

/// `sum` and the products of the values with the first entries of a row.
#[inline(always)]
fn add_products<R: Lanes>(sum: R, row: &[f64], values: &[R]) -> R {
    let (mut sum, row) = (sum, &row[..values.len()]);
    for (column, &value) in values.iter().enumerate() {
        sum = value.mul_add(R::splat(row[column]), sum);
    }
    sum
}
