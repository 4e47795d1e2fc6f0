//! One block of lanes: candidates that run side by side through one loading history.

use core::marker::PhantomData;

use crate::current_law::CurrentLaws;
use crate::damper::{DamperModel, DamperSpec, Motion, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::driver::{Driver, Following, Steady};
use crate::integrate::{advance, substeps};
use crate::lanes::Lanes;
use crate::loading::{Command, LoadingHistory};
use crate::misfit::{History, Sink, SquaredError};
use crate::parameters::FromSlice;
use crate::threads::StopRequested;

/// Steps between two looks at the stop flag and at lost lanes: well below a millisecond apart on a full block.
const STEPS_PER_CHECK: u32 = 512;

/// What candidates are compared with.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Measured force [N], one sample per time.
    pub force: &'a [f64],
    /// First sample that counts; those before it are simulated only.
    pub first: usize,
}

/// Candidates that share a sub-step count and run side by side.
pub struct Block<'a> {
    /// Parameters of the whole batch, row by row.
    pub theta: &'a [f64],
    /// How the parameters follow the command.
    pub laws: &'a CurrentLaws,
    /// Rows of `theta` that make up the block, at least one.
    pub candidates: &'a [usize],
    /// The motion.
    pub loading: &'a LoadingHistory,
    /// Sub-steps per sample interval, a power of two.
    pub substeps: u32,
    /// Whether the block is to be given up.
    pub stop: &'a StopRequested<'a>,
}

/// A damper model behind a pointer: whole blocks and single evaluations, nothing inside a time step.
pub trait Damper: Sync {
    /// What the model says of itself.
    fn spec(&self) -> &'static DamperSpec;
    /// Sub-steps per sample interval, `None` where the candidate cannot be resolved.
    fn substeps(
        &self,
        theta: &[f64],
        laws: &CurrentLaws,
        loading: &LoadingHistory,
        factor: u32,
    ) -> Option<u32>;
    /// Time derivative of the states.
    fn rate(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> Vec<f64>;
    /// Force [N].
    fn force(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> f64;
    /// Arithmetic operations of one step and one residual, a fused multiply-add counted as two.
    fn flops_per_step(&self, theta: &[f64]) -> u64;
    /// Sums of squared residuals against a measured force, one per candidate of the block.
    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> Vec<f64>;
    /// Force histories, one row per candidate of the block.
    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]);
}

impl<M: DamperModel> Damper for M {
    fn spec(&self) -> &'static DamperSpec {
        const { &M::SPEC }
    }

    fn substeps(
        &self,
        theta: &[f64],
        laws: &CurrentLaws,
        loading: &LoadingHistory,
        factor: u32,
    ) -> Option<u32> {
        substeps::<M>(theta, laws, loading, factor)
    }

    fn rate(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> Vec<f64> {
        let (p, state) = at_point::<M>(theta, state);
        let mut rate = Vec::with_capacity(M::SPEC.n_states);
        M::rate(&p, state, motion).for_each(|_, value| rate.push(value));
        rate
    }

    fn force(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> f64 {
        let (p, state) = at_point::<M>(theta, state);
        M::force(&p, state, motion)
    }

    fn flops_per_step(&self, theta: &[f64]) -> u64 {
        crate::peak::flops_per_step::<M>(theta)
    }

    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> Vec<f64> {
        set.run(block.candidates.len(), SquaredErrorJob::<M> { block, target, model: PhantomData })
    }

    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]) {
        set.run(block.candidates.len(), HistoryJob::<M> { block, rows, model: PhantomData });
    }
}

fn at_point<M: DamperModel>(theta: &[f64], state: &[f64]) -> (M::Parameters<f64>, M::State<f64>) {
    let entry = |index: usize| state.get(index).copied().unwrap_or(f64::NAN);
    (M::Parameters::from_slice(theta), M::State::from_fn(entry))
}

struct SquaredErrorJob<'a, M> {
    block: &'a Block<'a>,
    target: Target<'a>,
    model: PhantomData<M>,
}

impl<M: DamperModel> LaneJob for SquaredErrorJob<'_, M> {
    type Output = Vec<f64>;
    #[inline(always)]
    fn run<R: Lanes>(self) -> Vec<f64> {
        let mut sink =
            SquaredError { measured: self.target.force, first: self.target.first, sum: R::splat(0.0) };
        run_block::<M, R, _>(self.block, &mut sink);
        let mut sums = Vec::with_capacity(R::WIDTH);
        sink.sum.for_each(|_, sum| sums.push(sum));
        sums.truncate(self.block.candidates.len());
        sums
    }
}

struct HistoryJob<'a, 'b, M> {
    block: &'a Block<'a>,
    rows: &'a mut [&'b mut [f64]],
    model: PhantomData<M>,
}

impl<M: DamperModel> LaneJob for HistoryJob<'_, '_, M> {
    type Output = ();
    #[inline(always)]
    fn run<R: Lanes>(self) {
        run_block::<M, R, _>(self.block, &mut History { rows: self.rows });
    }
}

/// Simulates one block from rest. Lanes without a candidate repeat the last one.
#[inline(always)]
fn run_block<M: DamperModel, R: Lanes, S: Sink<R>>(block: &Block<'_>, sink: &mut S) {
    let Block { theta, laws, candidates, loading, substeps, .. } = *block;
    let n_columns = laws.n_columns();
    let last = candidates.len() - 1;
    let columns: Vec<R> = (0..n_columns)
        .map(|column| R::from_fn(|lane| theta[candidates[lane.min(last)] * n_columns + column]))
        .collect();
    if laws.are_constant() {
        let mut steady = Steady { parameters: M::Parameters::from_slice(&columns) };
        return run_driven::<M, R, S, _>(block, &mut steady, sink);
    }
    match loading.command() {
        Command::Held(command) => {
            let mut values = vec![R::splat(f64::NAN); laws.n_params()];
            laws.evaluate(&columns, R::splat(*command), &mut values);
            let mut steady = Steady { parameters: M::Parameters::from_slice(&values) };
            run_driven::<M, R, S, _>(block, &mut steady, sink);
        }
        Command::Varying(command) => {
            let step = loading.dt() / f64::from(substeps);
            run_driven::<M, R, S, _>(block, &mut Following::<M, R>::new(laws, columns, command, step), sink);
        }
    }
}

/// Simulates one block from rest with the parameters that its driver gives.
#[inline(always)]
fn run_driven<M: DamperModel, R: Lanes, S: Sink<R>, D: Driver<M, R>>(
    block: &Block<'_>,
    driver: &mut D,
    sink: &mut S,
) {
    let Block { loading, substeps, stop, .. } = *block;
    let fraction = 1.0 / f64::from(substeps);
    let step = loading.dt() * fraction;
    // A power of two, as both are: a mask finds its multiples without a division per sample.
    let check_every = (STEPS_PER_CHECK / substeps).max(1) as usize;
    let mut state = M::State::<R>::rest();
    for (sample, interval) in loading.intervals().iter().enumerate() {
        // Before the first sample too: the blocks that a stopped batch has left return at once.
        if sample & (check_every - 1) == 0 && (stop() || sink.is_lost()) {
            return;
        }
        let mut start = interval.motion(0.0);
        driver.begin(sample);
        sink.take(sample, M::force(driver.parameters(), state, start.splat()));
        if M::SPEC.n_states == 0 {
            driver.step();
        } else {
            for substep in 0..substeps {
                let u = f64::from(substep) * fraction;
                let middle = interval.motion(u + 0.5 * fraction);
                let end = interval.motion(u + fraction);
                state = advance::<M, R>(driver.step(), state, [start, middle, end], step);
                start = end;
            }
        }
    }
    driver.begin(loading.n_time() - 1);
    sink.take(loading.n_time() - 1, M::force(driver.parameters(), state, loading.last().splat()));
}
