//! One block of lanes: runs that go side by side through building, dampers and controller.

use core::marker::PhantomData;

use super::batch::Batch;
use super::dampers::{Dampers, END, MIDDLE};
use super::history::{History, Record};
use super::plant::Plant;
use super::reductions::{Balance, Reductions, Take};
use super::sample::{Controller, Sample};
use crate::damper::DamperModel;
use crate::dispatch::{InstructionSet, LaneJob};
use crate::ground_motion::GroundMotion;
use crate::lanes::Lanes;
use crate::threads::StopRequested;

/// Integration steps between two looks at the stop flag and at the balance of energies.
const STEPS_PER_CHECK: u32 = 512;

/// Runs that share the length of their motion and their step.
pub struct Block<'a> {
    /// The batch that they belong to.
    pub(super) batch: &'a Batch<'a>,
    /// Runs of the batch, at least one and at most as many as there are lanes.
    pub(super) runs: &'a [usize],
    /// Ground motion of each run.
    pub(super) motions: Vec<&'a GroundMotion>,
    /// Control samples.
    pub(super) n_samples: usize,
    /// Integration steps per sample.
    pub(super) steps: u32,
    /// Whether the block is to be given up.
    pub(super) stop: &'a StopRequested<'a>,
}

/// What a run left behind.
#[derive(Clone, Debug, Default)]
pub struct Left {
    /// Quantities in the order of [`super::reductions::layout`].
    pub(super) row: Vec<f64>,
    /// Largest rate, and change of rate per step at a reversal, device by device.
    pub(super) severity: Vec<[f64; 2]>,
    /// Whether the law was at a loss for a command.
    pub(super) at_a_loss: bool,
}

/// Runs a block; what each run left behind. Histories are written where they are asked for, run by run.
pub(crate) fn run<M: DamperModel>(
    set: InstructionSet,
    block: &Block<'_>,
    histories: &mut [History<'_>],
) -> Vec<Left> {
    set.run_middle(BlockJob::<M> { block, histories, model: PhantomData })
}

struct BlockJob<'a, 'b, M> {
    block: &'a Block<'a>,
    histories: &'a mut [History<'b>],
    model: PhantomData<M>,
}

impl<M: DamperModel> LaneJob for BlockJob<'_, '_, M> {
    type Output = Vec<Left>;
    #[inline(always)]
    fn run<R: Lanes>(self) -> Vec<Left> {
        let (reductions, at_a_loss) = march::<M, R>(self.block, self.histories);
        let n_devices = self.block.batch.places.len();
        let mut left = vec![Left::default(); self.block.runs.len()];
        at_a_loss.for_each(|lane, loss| {
            if let Some(left) = left.get_mut(lane) {
                left.at_a_loss = loss > 0.0;
            }
        });
        for (lane, left) in left.iter_mut().enumerate() {
            reductions.of_lane(lane, &mut left.row);
            left.severity = (0..n_devices).map(|device| reductions.severity(device, lane)).collect();
        }
        left
    }
}

/// The ground under all lanes.
struct Ground<'a> {
    motions: &'a [&'a GroundMotion],
    /// Whether it is the same in all.
    uniform: bool,
}

impl<'a> Ground<'a> {
    fn new(motions: &'a [&'a GroundMotion]) -> Self {
        let uniform = motions.iter().all(|motion| core::ptr::eq(*motion, motions[0]));
        Self { motions, uniform }
    }

    #[inline(always)]
    fn acceleration<R: Lanes>(&self, time: f64) -> R {
        if self.uniform {
            return R::splat(self.motions[0].acceleration(time));
        }
        let last = self.motions.len() - 1;
        R::from_fn(|lane| self.motions[lane.min(last)].acceleration(time))
    }

    #[inline(always)]
    fn velocity<R: Lanes>(&self, time: f64) -> R {
        if self.uniform {
            return R::splat(self.motions[0].velocity(time));
        }
        let last = self.motions.len() - 1;
        R::from_fn(|lane| self.motions[lane.min(last)].velocity(time))
    }
}

/// Marches a block to its end: its reductions, and which lanes were once at a loss for a command.
///
/// Classical Runge-Kutta in the form for accelerations: the displacement takes h v + h^2 (a1 + a2 + a3)/6.
#[inline(always)]
fn march<M: DamperModel, R: Lanes>(block: &Block<'_>, histories: &mut [History<'_>]) -> (Reductions<R>, R) {
    let Block { batch, runs, n_samples, steps, stop, .. } = *block;
    let Batch { building, hardware, .. } = *batch;
    let step = hardware.sample_time / f64::from(steps);
    let (half, sixth, third) = (0.5 * step, step / 6.0, step / 3.0);
    let delay = hardware.delay_steps * (steps / hardware.steps) as usize;
    let last = runs.len() - 1;
    let streams: Vec<u64> = (0..R::WIDTH).map(|lane| batch.runs[runs[lane.min(last)]].stream).collect();
    let ground = Ground::new(&block.motions);
    let check_every = (STEPS_PER_CHECK / steps).max(1) as usize;

    let mut plant = Plant::<R>::at_rest(building, step);
    let mut dampers = Dampers::<M, R>::new(batch, runs, step);
    let mut controller = Controller::<R>::new(batch, runs);
    let mut reductions = Reductions::<R>::new(building);
    let mut end = ground.acceleration::<R>(0.0);
    for sample in 0..n_samples {
        if sample % check_every == 0 {
            if stop() {
                break;
            }
            R::apart(Balance {
                building,
                displacement: &plant.displacement,
                velocity: &plant.velocity,
                into: &mut reductions,
            });
        }
        for inner in 0..steps as usize {
            let index = sample * steps as usize + inner;
            let start = end;
            dampers.resist(&plant.elongation, &plant.rate, END);
            plant.accelerate(0, &dampers.force, start);
            if inner == 0 {
                R::apart(Sample {
                    batch,
                    streams: &streams,
                    number: sample,
                    displacement: &plant.displacement,
                    velocity: &plant.velocity,
                    acceleration: plant.acceleration(),
                    force: &dampers.force,
                    ground_acceleration: start,
                    ground_velocity: ground.velocity(time(sample, hardware.sample_time)),
                    controller: &mut controller,
                });
            }
            // The very first command has been there since long before.
            let arrived = index == 0 || (index >= delay && (index - delay).is_multiple_of(steps as usize));
            if arrived {
                let commands = controller.sent_at(index.saturating_sub(delay) / steps as usize);
                if dampers.hold(commands, index == 0) {
                    dampers.resist(&plant.elongation, &plant.rate, END);
                    plant.accelerate(0, &dampers.force, start);
                }
            }
            R::apart(Take {
                building,
                displacement: &plant.displacement,
                velocity: &plant.velocity,
                acceleration: plant.acceleration(),
                force: &dampers.force,
                current: &dampers.current,
                ground_acceleration: start,
                into: &mut reductions,
            });
            if inner == 0 && !histories.is_empty() {
                R::apart(Record {
                    building,
                    sample,
                    displacement: &plant.displacement,
                    velocity: &plant.velocity,
                    acceleration: plant.acceleration(),
                    force: &dampers.force,
                    current: &dampers.current,
                    command: controller.sent_at(sample),
                    ground_acceleration: start,
                    reductions: &reductions,
                    rows: histories,
                });
            }
            dampers.follow();
            let middle = ground.acceleration::<R>(time(2 * index + 1, half));
            end = ground.acceleration(time(index + 1, step));
            let stages =
                [(sixth, half, middle, MIDDLE), (third, half, middle, MIDDLE), (third, step, end, END)];
            for (stage, (weight, reach, shaking, moment)) in stages.into_iter().enumerate() {
                plant.advance(stage, &dampers.force, &mut reductions);
                dampers.stage(weight, reach);
                dampers.resist(&plant.elongation, &plant.rate, moment);
                plant.accelerate(stage + 1, &dampers.force, shaking);
            }
            plant.advance(stages.len(), &dampers.force, &mut reductions);
            dampers.stage(sixth, 0.0);
        }
    }
    R::apart(Balance {
        building,
        displacement: &plant.displacement,
        velocity: &plant.velocity,
        into: &mut reductions,
    });
    (reductions, controller.at_a_loss)
}

/// So many steps later [s].
#[inline(always)]
fn time(count: usize, step: f64) -> f64 {
    #[allow(clippy::cast_precision_loss)] // counts of steps are far below 2^53
    let count = count as f64;
    count * step
}
