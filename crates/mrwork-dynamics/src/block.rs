//! One block of lanes: candidates that are simulated together under one loading history.

use core::marker::PhantomData;
use core::ops::Range;

use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, DamperSpec, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::driver::{Driver, Following, Steady};
use crate::integrate::advance;
use crate::lanes::Lanes;
use crate::loading::{Command, LoadingHistory};
use crate::misfit::{ForceAccumulator, ForceOutput, ForceSink};
use crate::parameters::FromSlice;
use crate::real::Real;
use crate::threads::StopRequested;

/// Steps between two checks for cancellation and for settled lanes: well below a millisecond on a full block.
const STEPS_PER_CHECK: u32 = 512;

/// Candidates with the same number of sub-steps, simulated together.
pub struct Block<'a> {
    /// Parameters of the whole batch, row-major.
    pub theta: &'a [f64],
    /// Current law of each parameter.
    pub laws: &'a CurrentLaws,
    /// Rows of `theta` that make up the block, at least one.
    pub candidates: &'a [usize],
    /// The loading history.
    pub loading: &'a LoadingHistory,
    /// Samples to simulate.
    pub span: Range<usize>,
    /// States and sums of the batch at the start of the span.
    pub progress: &'a BatchProgress,
    /// Sub-steps per sample interval, a power of two.
    pub substeps: u32,
    /// Whether the caller wants to cancel.
    pub stop: &'a StopRequested<'a>,
}

/// States and sums of the candidates of a batch, between two spans of the record.
pub struct BatchProgress {
    n_states: usize,
    /// Row-major, shape (batch, states).
    states: Vec<f64>,
    /// Sums of squared residuals so far [N^2].
    pub sums: Vec<f64>,
    /// Sums at which candidates are abandoned [N^2]; infinite for no limit.
    pub limits: Vec<f64>,
}

impl BatchProgress {
    /// Initial state: at rest, nothing summed.
    pub(crate) fn at_rest(spec: &DamperSpec, n_batch: usize, limits: Option<&[f64]>) -> Self {
        Self {
            n_states: spec.n_states,
            states: vec![0.0; n_batch * spec.n_states],
            sums: vec![0.0; n_batch],
            limits: limits.map_or_else(|| vec![f64::INFINITY; n_batch], <[f64]>::to_vec),
        }
    }

    /// Copies the result of a lane to its candidate.
    pub(crate) fn take(&mut self, candidate: usize, result: &BlockResult, lane: usize) {
        let n = self.n_states;
        self.sums[candidate] = result.sums[lane];
        self.states[candidate * n..][..n].copy_from_slice(&result.states[lane * n..][..n]);
    }

    /// Whether the sum of a candidate is below its limit.
    pub(crate) fn is_within(&self, candidate: usize) -> bool {
        self.sums[candidate] < self.limits[candidate]
    }
}

/// Sums and states at the end of a block's span.
pub struct BlockResult {
    /// Sums of squared residuals [N^2], lane by lane; zero without a target.
    pub sums: Vec<f64>,
    /// States, lane by lane.
    pub states: Vec<f64>,
    /// Number of samples simulated.
    pub samples: usize,
}

/// Simulates a block.
pub(crate) fn run<M: DamperModel>(
    set: InstructionSet,
    block: &Block<'_>,
    output: ForceOutput<'_, '_>,
) -> BlockResult {
    match block.loading.command() {
        Command::Varying(command) if !block.laws.are_constant() => {
            set.run_narrow(FollowingJob::<M> { block, output, command, model: PhantomData })
        }
        _ => set.run(block.candidates.len(), SteadyJob::<M> { block, output, model: PhantomData }),
    }
}

/// A block whose parameters are constant in time.
struct SteadyJob<'a, 'b, M> {
    block: &'a Block<'a>,
    output: ForceOutput<'a, 'b>,
    model: PhantomData<M>,
}

impl<M: DamperModel> LaneJob for SteadyJob<'_, '_, M> {
    type Output = BlockResult;
    const WIDE: bool = M::EXPONENT.is_some();
    #[inline(always)]
    fn run<R: Lanes>(self) -> BlockResult {
        let values = steady_values(self.block, columns::<R>(self.block));
        let mut steady = Steady { parameters: M::Parameters::from_slice(&values) };
        run_block::<M, R, _>(self.block, &mut steady, self.output)
    }
}

/// A block whose parameters follow a varying command.
struct FollowingJob<'a, 'b, M> {
    block: &'a Block<'a>,
    output: ForceOutput<'a, 'b>,
    command: &'a [f64],
    model: PhantomData<M>,
}

impl<M: DamperModel> LaneJob for FollowingJob<'_, '_, M> {
    type Output = BlockResult;
    #[inline(always)]
    fn run<R: Lanes>(self) -> BlockResult {
        let Block { laws, loading, substeps, .. } = *self.block;
        let step = loading.dt() / f64::from(substeps);
        let columns = columns::<R>(self.block);
        let mut following = Following::<M, R>::new(laws, columns, self.command, step);
        run_block::<M, R, _>(self.block, &mut following, self.output)
    }
}

/// Parameters that are constant in time, from columns: those at the constant command, if there is one.
#[inline(always)]
pub(crate) fn steady_values<R: Real>(block: &Block<'_>, mut columns: Vec<R>) -> Vec<R> {
    let Block { laws, loading, .. } = *block;
    if let (false, Command::Held(command)) = (laws.are_constant(), loading.command()) {
        let mut values = vec![R::splat(f64::NAN); laws.n_params()];
        laws.prepare(&mut columns);
        laws.evaluate(&columns, R::splat(*command), &mut values);
        columns = values;
    }
    columns
}

/// The columns of `theta`, one candidate per lane. Excess lanes repeat the last candidate.
#[inline(always)]
pub(crate) fn columns<R: Lanes>(block: &Block<'_>) -> Vec<R> {
    let Block { theta, laws, candidates, .. } = *block;
    let n_columns = laws.n_columns();
    let last = candidates.len() - 1;
    (0..n_columns)
        .map(|column| R::from_fn(|lane| theta[candidates[lane.min(last)] * n_columns + column]))
        .collect()
}

/// Simulates a block over its span with the parameters of `driver`.
#[inline(always)]
fn run_block<M: DamperModel, R: Lanes, D: Driver<M, R>>(
    block: &Block<'_>,
    driver: &mut D,
    output: ForceOutput<'_, '_>,
) -> BlockResult {
    let Block { candidates, progress, .. } = *block;
    let last = candidates.len() - 1;
    let candidate = |lane: usize| candidates[lane.min(last)];
    let n_states = M::SPEC.n_states;
    let mut accumulator = ForceAccumulator {
        output,
        sum: R::from_fn(|lane| progress.sums[candidate(lane)]),
        limit: R::from_fn(|lane| progress.limits[candidate(lane)]),
    };
    let state = M::State::<R>::from_fn(|entry| {
        R::from_fn(|lane| progress.states[candidate(lane) * n_states + entry])
    });
    let (state, samples) = integrate_span::<M, R, D>(block, driver, state, &mut accumulator);
    let mut sums = Vec::with_capacity(R::WIDTH);
    accumulator.sum.for_each(|_, sum| sums.push(sum));
    let mut states = vec![0.0; R::WIDTH * n_states];
    state.for_each(|entry, values| values.for_each(|lane, value| states[lane * n_states + entry] = value));
    BlockResult { sums, states, samples }
}

/// Integrates a block over its span; returns the final states and the number of samples simulated.
#[inline(always)]
pub(crate) fn integrate_span<M: DamperModel, R: Real, D: Driver<M, R>>(
    block: &Block<'_>,
    driver: &mut D,
    mut state: M::State<R>,
    sink: &mut impl ForceSink<M, R, D>,
) -> (M::State<R>, usize) {
    let Block { loading, ref span, substeps, stop, .. } = *block;
    let fraction = 1.0 / f64::from(substeps);
    let step = loading.dt() * fraction;
    // A power of two, as both factors are: a mask finds its multiples without a division per sample.
    let check_every = (STEPS_PER_CHECK / substeps).max(1) as usize;
    let mut samples = 0;
    for (interval, sample) in loading.intervals()[span.start..].iter().zip(span.clone()) {
        // Checked before the first sample too, so that the remaining blocks of a cancelled batch return at once.
        if samples & (check_every - 1) == 0 && (stop() || sink.is_settled()) {
            break;
        }
        let mut start = interval.motion(0.0);
        driver.begin(sample);
        sink.take(sample, driver, state, start.splat());
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
        samples += 1;
    }
    if span.start + samples == loading.n_time() - 1 && span.end == loading.n_time() {
        driver.begin(loading.n_time() - 1);
        sink.take(loading.n_time() - 1, driver, state, loading.last().splat());
        samples += 1;
    }
    (state, samples)
}
