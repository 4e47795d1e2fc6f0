//! One block of lanes: closed-loop runs that are simulated together.

use super::batch::Batch;
use super::directions::Directions;
use super::history::{HistoryRows, WriteHistory};
use super::reductions::{BalanceEnergies, ReduceStep, Reductions};
use super::sample::{Controller, Sample};
use crate::building::Building;
use crate::control::Preview;
use crate::coupled::{Coupled, Devices, Plant, devices_at_rest};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::dual::Dual;
use crate::dual_block::TANGENTS;
use crate::error::DynamicsError;
use crate::ground_motion::{GroundMotion, Place};
use crate::lanes::{Lanes, MOST_LANES};
use crate::real::{Bits, OutOfLine};
use crate::threads::StopRequested;

/// Integration steps between two checks for cancellation and of the energy balance.
const STEPS_PER_CHECK: u32 = 512;

/// Runs with the same number of control samples and the same integration step.
pub struct Block<'a> {
    /// The batch that the runs belong to.
    pub(super) batch: &'a Batch<'a>,
    /// Indices of the runs: at least one, at most one per lane.
    pub(super) runs: &'a [usize],
    /// Ground motion of each run.
    pub(super) motions: Vec<&'a GroundMotion>,
    /// Its accelerations at start, middle and end of each step where it is finer than the step.
    pub(super) stages: Vec<Option<&'a [[f64; 3]]>>,
    /// The same of its forces, of every step those of all floors.
    pub(super) force_stages: Vec<Option<&'a [[f64; 3]]>>,
    /// Number of control samples.
    pub(super) n_samples: usize,
    /// Integration steps per sample.
    pub(super) steps: u32,
    /// Directions of the derivatives, if there are any.
    pub(super) directions: Option<Directions<'a>>,
    /// Whether the caller wants to cancel.
    pub(super) stop: &'a StopRequested<'a>,
}

/// Result of one lane of a block.
#[derive(Clone, Debug, Default)]
pub struct LaneResult {
    /// Summary in the order of [`super::RUN_QUANTITIES`].
    pub(super) row: Vec<f64>,
    /// Its derivatives along the directions of the lane, one row after the other; empty without directions.
    pub(super) slopes: Vec<f64>,
    /// Per device: largest rate, and largest change of the rate in a step in which it changed sign [m/s].
    pub(super) severity: Vec<[f64; 2]>,
    /// The same per element.
    pub(super) element_severity: Vec<[f64; 2]>,
    /// Per device: fastest relaxation of the states of dampers that are watched [1/s].
    pub(super) fastest: Vec<f64>,
    /// Whether a command was not a number.
    pub(super) command_invalid: bool,
}

/// Simulates a block; one result per run. Histories are written if requested, one per run.
///
/// # Errors
/// For a model of dampers that is not registered.
pub(super) fn simulate(
    set: InstructionSet,
    block: &Block<'_>,
    histories: &mut [HistoryRows<'_>],
) -> Result<Vec<LaneResult>, DynamicsError> {
    match block.directions {
        None => set.run_middle(block.runs.len(), BlockJob { block, histories }),
        Some(_) => set.run_vector(SlopesJob { block }),
    }
}

struct BlockJob<'a, 'b> {
    block: &'a Block<'a>,
    histories: &'a mut [HistoryRows<'b>],
}

impl LaneJob for BlockJob<'_, '_> {
    type Output = Result<Vec<LaneResult>, DynamicsError>;
    type Home = Self;
    #[inline(always)]
    fn run<R: Lanes>(self) -> Self::Output {
        simulate_lanes::<R>(self.block, self.histories)
    }
}

/// The same with derivatives.
struct SlopesJob<'a> {
    block: &'a Block<'a>,
}

impl LaneJob for SlopesJob<'_> {
    type Output = Result<Vec<LaneResult>, DynamicsError>;
    type Home = Self;
    #[inline(always)]
    fn run<R: Lanes + Bits>(self) -> Self::Output {
        simulate_lanes::<Dual<R, TANGENTS>>(self.block, &mut [])
    }
}

#[inline(always)]
fn simulate_lanes<R: Lanes>(
    block: &Block<'_>,
    histories: &mut [HistoryRows<'_>],
) -> Result<Vec<LaneResult>, DynamicsError> {
    let Block { batch, runs, .. } = *block;
    let last = runs.len() - 1;
    let draw = |lane: usize| batch.runs[runs[lane.min(last)]].draw as usize;
    let devices = devices_at_rest(batch.dampers, |group, device, column| {
        R::from_fn(|lane| group.theta_of(draw(lane), device)[column])
    })?;
    let mut results = vec![LaneResult::default(); runs.len()];
    R::out_of_line(IntegrateBlock { block, histories, devices, results: &mut results });
    Ok(results)
}

/// A block with its devices.
struct IntegrateBlock<'a, 'b, R: Lanes> {
    block: &'a Block<'a>,
    histories: &'a mut [HistoryRows<'b>],
    devices: Box<dyn Devices<R> + 'a>,
    results: &'a mut [LaneResult],
}

impl<R: Lanes> OutOfLine for IntegrateBlock<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { block, histories, devices, results } = self;
        let (reductions, command_invalid, fastest) = integrate_block::<R>(block, histories, devices);
        for relaxation in &fastest {
            relaxation.for_each(|lane, value| {
                if let Some(result) = results.get_mut(lane) {
                    result.fastest.push(value);
                }
            });
        }
        command_invalid.for_each(|lane, invalid| {
            if let Some(result) = results.get_mut(lane) {
                result.command_invalid = invalid > 0.0;
            }
        });
        let quantities = reductions.quantities();
        for (column, quantity) in quantities.iter().enumerate() {
            quantity.for_each(|lane, value| {
                if let Some(result) = results.get_mut(lane) {
                    result.row.push(value);
                }
            });
            quantity.for_each_slope(|lane, direction, slope| {
                if let Some(LaneResult { slopes, .. }) = results.get_mut(lane) {
                    slopes.resize(TANGENTS * quantities.len(), 0.0);
                    slopes[direction * quantities.len() + column] = slope;
                }
            });
        }
        for (lane, result) in results.iter_mut().enumerate() {
            result.severity = reductions.severity(lane);
            result.element_severity = reductions.element_severity(lane);
        }
    }
}

/// Ground motion of all lanes.
struct Ground<'a> {
    motions: &'a [&'a GroundMotion],
    stages: &'a [Option<&'a [[f64; 3]]>],
    step: f64,
    /// Whether all lanes have the same motion.
    uniform: bool,
    /// Whether the state of a lane has absolute velocities.
    absolute: bool,
}

impl<'a> Ground<'a> {
    fn new(block: &'a Block<'_>, step: f64) -> Self {
        let Block { motions, stages, .. } = block;
        let uniform = motions.iter().all(|motion| core::ptr::eq(*motion, motions[0]));
        let absolute = motions.iter().any(|motion| motion.is_absolute());
        Self { motions, stages, step, uniform, absolute }
    }

    /// A number of each lane; one, where all lanes have the same motion.
    #[inline(always)]
    fn lanes<R: Lanes>(&self, value: impl Fn(usize) -> f64) -> R {
        if self.uniform {
            return R::splat(value(0));
        }
        let last = self.motions.len() - 1;
        R::from_fn(|lane| value(lane.min(last)))
    }

    /// By the record.
    #[inline(always)]
    fn record<R: Lanes>(&self, time: f64) -> R {
        self.lanes(|lane| self.motions[lane].acceleration(time))
    }

    /// At a stage of a step, in half steps after its start.
    ///
    /// In a loop: a closure is compiled without the instructions of the set, and this is asked twice in a step.
    #[inline(always)]
    fn stage<R: Lanes>(&self, number: usize, stage: usize) -> R {
        let now = time(2 * number + stage, 0.5 * self.step);
        if self.uniform {
            return R::splat(self.at_stage(0, now, number, stage));
        }
        let mut values = [0.0; MOST_LANES];
        for (lane, value) in values.iter_mut().enumerate().take(self.motions.len()) {
            *value = self.at_stage(lane, now, number, stage);
        }
        let last = self.motions.len() - 1;
        R::from_fn(|lane| values[lane.min(last)])
    }

    #[inline(always)]
    fn at_stage(&self, lane: usize, now: f64, number: usize, stage: usize) -> f64 {
        match self.stages[lane] {
            Some(stages) => stages[number][stage],
            None => self.motions[lane].acceleration(now),
        }
    }

    /// As the sensor takes it.
    #[inline(always)]
    fn reading<R: Lanes>(&self, time: f64, step: f64) -> R {
        self.lanes(|lane| self.motions[lane].reading(time, step))
    }

    #[inline(always)]
    fn velocity<R: Lanes>(&self, time: f64) -> R {
        self.lanes(|lane| self.motions[lane].velocity(time))
    }

    /// Velocity in the state that laws read: zero in lanes where that is relative, none if it is in all.
    #[inline(always)]
    fn of_state<R: Lanes>(&self, time: f64) -> Option<R> {
        self.absolute.then(|| {
            self.lanes(|lane| {
                let motion = self.motions[lane];
                if motion.is_absolute() { motion.velocity(time) } else { 0.0 }
            })
        })
    }
}

/// Forces on the floors of all lanes, which all have forces or none.
struct Forces<'a> {
    motions: &'a [&'a GroundMotion],
    stages: &'a [Option<&'a [[f64; 3]]>],
    step: f64,
    count: usize,
    uniform: bool,
    /// Where each lane is among its samples.
    places: Vec<Place>,
}

impl<'a> Forces<'a> {
    fn new(block: &'a Block<'_>, ground: &Ground<'_>) -> Self {
        let Block { motions, force_stages, .. } = block;
        let count = motions[0].n_forced();
        Self {
            motions,
            stages: force_stages,
            step: ground.step,
            count,
            uniform: ground.uniform,
            places: Vec::new(),
        }
    }

    /// Gives the plant those of a step, if there are any; only of histories finer than the step do steps not join.
    #[inline(always)]
    fn place<R: Lanes>(&mut self, number: usize, is_fine: bool, plant: &mut Plant<'_, R>) {
        if self.count > 0 {
            let follows = number > 0 && !is_fine;
            R::out_of_line(PlaceForces { forces: self, number, follows, plant });
        }
    }

    /// Writes minus the forces at a stage of a step, in half steps after its start.
    #[inline(always)]
    fn write<R: Lanes>(&mut self, number: usize, stage: usize, into: &mut Vec<R>) {
        let own = if self.uniform { 1 } else { self.motions.len() };
        let now = time(2 * number + stage, 0.5 * self.step);
        self.places.clear();
        for motion in &self.motions[..own] {
            self.places.push(motion.place(now));
        }
        into.clear();
        // In a loop, as accelerations of the ground are.
        let mut values = [0.0; MOST_LANES];
        for floor in 0..self.count {
            for (lane, value) in values.iter_mut().enumerate().take(own) {
                *value = match self.stages[lane] {
                    Some(stages) => -stages[number * self.count + floor][stage],
                    None => -self.motions[lane].force(floor, self.places[lane]),
                };
            }
            into.push(if self.uniform {
                R::splat(values[0])
            } else {
                R::from_fn(|lane| values[lane.min(own - 1)])
            });
        }
    }
}

/// Writes minus the forces of a step into the plant; those at its start are the last ones of the step before where it
/// `follows` that.
struct PlaceForces<'a, 'b, 'c, R: Lanes> {
    forces: &'a mut Forces<'b>,
    number: usize,
    follows: bool,
    plant: &'a mut Plant<'c, R>,
}

impl<R: Lanes> OutOfLine for PlaceForces<'_, '_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { forces, number, follows, plant: Plant { on_floors, .. } } = self;
        on_floors.swap(0, 2);
        for (stage, into) in on_floors.iter_mut().enumerate().skip(usize::from(follows)) {
            forces.write(number, stage, into);
        }
    }
}

/// Commands on their way from the controller to the drivers; lanes differ in the delay.
struct Arrivals<R> {
    /// Delays, each with 1 in the lanes that have it, else 0.
    delays: Vec<(Delay, R)>,
    /// Commands that have arrived last.
    received: Vec<R>,
}

/// Whole samples of a delay, and the integration steps beyond them.
#[derive(Clone, Copy)]
struct Delay {
    samples: usize,
    steps: usize,
}

impl Delay {
    fn of(delay: usize, steps: usize) -> Self {
        Self { samples: delay / steps, steps: delay % steps }
    }
}

impl<R: Lanes> Arrivals<R> {
    fn new(batch: &Batch<'_>, runs: &[usize], steps: u32) -> Self {
        let finer = (steps / batch.hardware.steps) as usize;
        let own: Vec<usize> = runs.iter().map(|&run| batch.delay_of(run) * finer).collect();
        let (mut distinct, last) = (own.clone(), own.len() - 1);
        distinct.sort_unstable();
        distinct.dedup();
        let lanes = |delay| R::from_fn(|lane| f64::from(u8::from(own[lane.min(last)] == delay)));
        Self {
            delays: distinct
                .into_iter()
                .map(|delay| (Delay::of(delay, steps as usize), lanes(delay)))
                .collect(),
            received: vec![R::splat(0.0); batch.n_devices()],
        }
    }

    /// Takes the commands that arrive at a step of a sample; returns whether there are any.
    ///
    /// A driver that receives its command once more does not change.
    #[inline(always)]
    fn take(&mut self, sample: usize, inner: usize, controller: &Controller<'_, R>) -> bool {
        let mut arrived = false;
        for &(Delay { samples, steps }, lanes) in &self.delays {
            // The first command is in force from the start, without delay.
            if (sample == 0 && inner == 0) || (inner == steps && sample >= samples) {
                arrived = true;
                let sent = controller.sent_at(sample.saturating_sub(samples));
                if self.delays.len() == 1 {
                    self.received.copy_from_slice(sent);
                    continue;
                }
                for (received, &sent) in self.received.iter_mut().zip(sent) {
                    *received = R::select(R::splat(0.5).less(lanes), sent, *received);
                }
            }
        }
        arrived
    }
}

/// Integrates a block to its end; returns its reductions, and a number above zero in lanes with an invalid command.
#[inline(always)]
fn integrate_block<R: Lanes>(
    block: &Block<'_>,
    histories: &mut [HistoryRows<'_>],
    mut devices: Box<dyn Devices<R> + '_>,
) -> (Reductions<R>, R, Vec<R>) {
    let Block { batch, runs, n_samples, steps, stop, .. } = *block;
    let Batch { building, hardware, .. } = *batch;
    let step = hardware.sample_time / f64::from(steps);
    let last = runs.len() - 1;
    let springs: Vec<_> = runs.iter().map(|&run| &batch.springs_of(run).rows).collect();
    let streams: Vec<u64> = (0..R::WIDTH).map(|lane| batch.runs[runs[lane.min(last)]].stream).collect();
    let ground = Ground::new(block, step);
    let is_fine = block.stages.iter().any(Option::is_some);
    let mut forces = Forces::new(block, &ground);

    devices.set_step(step);
    let mut coupled = Coupled { plant: Plant::<R>::at_rest(building, &springs, step), devices };
    let mut arrivals = Arrivals::<R>::new(batch, runs, steps);
    let mut controller = Controller::<'_, R>::new(batch, runs, block.directions);
    let mut reductions = Reductions::<R>::new(building, step);
    let mut end = ground.record::<R>(0.0);
    let mut next_check = 0;
    for sample in 0..n_samples {
        if sample == next_check {
            next_check += (STEPS_PER_CHECK / steps).max(1) as usize;
            if stop() {
                break;
            }
            R::out_of_line(BalanceEnergies { plant: &coupled.plant, into: &mut reductions });
        }
        for inner in 0..steps as usize {
            let index = sample * steps as usize + inner;
            let start = if is_fine { ground.stage(index, 0) } else { end };
            forces.place(index, is_fine, &mut coupled.plant);
            coupled.evaluate(&start);
            if inner == 0 {
                let now = time(sample, hardware.sample_time);
                let of_hardware = hardware.sample_time / f64::from(hardware.steps);
                R::out_of_line(Sample {
                    batch,
                    runs,
                    streams: &streams,
                    number: sample,
                    motion: coupled.plant.motion(),
                    force: coupled.devices.force(),
                    ground_acceleration: &start,
                    ground_reading: &ground.reading(time(index, step), of_hardware),
                    ground_velocity: &ground.velocity(now),
                    state_ground: ground.of_state(now),
                    preview: Preview {
                        motions: &block.motions,
                        now,
                        reach: hardware.ground_preview,
                        step: of_hardware,
                    },
                    controller: &mut controller,
                });
                reductions.take_commands(sample, controller.sent_at(sample), batch.ranges);
            }
            if arrivals.take(sample, inner, &controller)
                && coupled.devices.receive(&arrivals.received, index == 0)
            {
                coupled.evaluate(&start);
            }
            reduce(building, &coupled, &start, &mut reductions);
            if inner == 0 && !histories.is_empty() {
                R::out_of_line(WriteHistory {
                    building,
                    sample,
                    coupled: &coupled,
                    command: controller.sent_at(sample),
                    record: ground.record(time(index, step)),
                    ground_acceleration: start,
                    reductions: &reductions,
                    rows: histories,
                });
            }
            let middle = ground.stage::<R>(index, 1);
            end = ground.stage(index, 2);
            coupled.advance(&middle, &end, Some(&mut reductions.energies));
        }
    }
    R::out_of_line(BalanceEnergies { plant: &coupled.plant, into: &mut reductions });
    coupled.plant.on_floors.swap(0, 2);
    coupled.evaluate(&end);
    let sums = reductions.clone();
    reduce(building, &coupled, &end, &mut reductions);
    reductions.keep_sums(sums);
    if !histories.is_empty() {
        R::out_of_line(WriteHistory {
            building,
            sample: n_samples,
            coupled: &coupled,
            // No sample follows: the last command is still held.
            command: controller.sent_at(n_samples - 1),
            record: ground.record(time(n_samples * steps as usize, step)),
            ground_acceleration: end,
            reductions: &reductions,
            rows: histories,
        });
    }
    (reductions, controller.command_invalid, coupled.devices.fastest())
}

/// Adds the start of a step, or the end of a run, to the reductions.
#[inline(always)]
fn reduce<R: Lanes>(
    building: &Building,
    coupled: &Coupled<'_, R>,
    ground_acceleration: &R,
    into: &mut Reductions<R>,
) {
    R::out_of_line(ReduceStep {
        building,
        motion: coupled.plant.motion(),
        force: coupled.devices.force(),
        current: coupled.devices.current(),
        ground_acceleration,
        on_floors: &coupled.plant.on_floors[0],
        into,
    });
}

/// Time after `count` steps [s].
#[inline(always)]
fn time(count: usize, step: f64) -> f64 {
    #[allow(clippy::cast_precision_loss)] // counts of steps are far below 2^53
    let count = count as f64;
    count * step
}
