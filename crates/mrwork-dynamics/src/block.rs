//! One block of lanes: candidates that run side by side through one loading history.

use core::marker::PhantomData;
use core::ops::Range;

use crate::current_law::CurrentLaws;
use crate::damper::{DamperModel, DamperSpec, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::driver::{Driver, Following, Steady};
use crate::integrate::advance;
use crate::lanes::Lanes;
use crate::loading::{Command, LoadingHistory};
use crate::misfit::{Keep, Keeper, Kept};
use crate::parameters::FromSlice;
use crate::real::Real;
use crate::threads::StopRequested;

/// Steps between two looks at the stop flag and at lost lanes: well below a millisecond apart on a full block.
const STEPS_PER_CHECK: u32 = 512;

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
    /// Samples to simulate.
    pub span: Range<usize>,
    /// Where the candidates of the batch stand at the first of them.
    pub standings: &'a Standings,
    /// Sub-steps per sample interval, a power of two.
    pub substeps: u32,
    /// Whether the block is to be given up.
    pub stop: &'a StopRequested<'a>,
}

/// Where the candidates of a batch stand between two spans of the record.
pub struct Standings {
    n_states: usize,
    /// Row by row.
    states: Vec<f64>,
    /// Sums of squared residuals so far [N^2].
    pub sums: Vec<f64>,
    /// Sums at which candidates are given up [N^2], infinite where never.
    pub limits: Vec<f64>,
}

impl Standings {
    /// All at rest.
    pub(crate) fn at_rest(spec: &DamperSpec, n_batch: usize, limits: Option<&[f64]>) -> Self {
        Self {
            n_states: spec.n_states,
            states: vec![0.0; n_batch * spec.n_states],
            sums: vec![0.0; n_batch],
            limits: limits.map_or_else(|| vec![f64::INFINITY; n_batch], <[f64]>::to_vec),
        }
    }

    /// Takes over how far a candidate has come.
    pub(crate) fn take(&mut self, candidate: usize, reached: &Reached, lane: usize) {
        let n = self.n_states;
        self.sums[candidate] = reached.sums[lane];
        self.states[candidate * n..][..n].copy_from_slice(&reached.states[lane * n..][..n]);
    }

    /// Whether a candidate is to be simulated further.
    pub(crate) fn is_within(&self, candidate: usize) -> bool {
        self.sums[candidate] < self.limits[candidate]
    }
}

/// How far a block has come.
pub struct Reached {
    /// Sums of squared residuals [N^2], lane by lane; zero without a target.
    pub sums: Vec<f64>,
    /// States, lane by lane.
    pub states: Vec<f64>,
    /// Samples simulated.
    pub samples: usize,
}

/// Runs a block.
pub(crate) fn run<M: DamperModel>(set: InstructionSet, block: &Block<'_>, keep: Keep<'_, '_>) -> Reached {
    match block.loading.command() {
        Command::Varying(command) if !block.laws.are_constant() => {
            set.run_narrow(FollowingJob::<M> { block, keep, command, model: PhantomData })
        }
        _ => set.run(block.candidates.len(), SteadyJob::<M> { block, keep, model: PhantomData }),
    }
}

/// The parameters stay what they are at the first command.
struct SteadyJob<'a, 'b, M> {
    block: &'a Block<'a>,
    keep: Keep<'a, 'b>,
    model: PhantomData<M>,
}

impl<M: DamperModel> LaneJob for SteadyJob<'_, '_, M> {
    type Output = Reached;
    #[inline(always)]
    fn run<R: Lanes>(self) -> Reached {
        let mut steady = steady::<M, R>(self.block, columns(self.block));
        run_block::<M, R, _>(self.block, &mut steady, self.keep)
    }
}

/// The parameters follow the command.
struct FollowingJob<'a, 'b, M> {
    block: &'a Block<'a>,
    keep: Keep<'a, 'b>,
    command: &'a [f64],
    model: PhantomData<M>,
}

impl<M: DamperModel> LaneJob for FollowingJob<'_, '_, M> {
    type Output = Reached;
    #[inline(always)]
    fn run<R: Lanes>(self) -> Reached {
        let Block { laws, loading, substeps, .. } = *self.block;
        let step = loading.dt() / f64::from(substeps);
        let columns = columns::<R>(self.block);
        let mut following = Following::<M, R>::new(laws, columns, self.command, step);
        run_block::<M, R, _>(self.block, &mut following, self.keep)
    }
}

/// The driver whose parameters stay what they are at the first command.
#[inline(always)]
pub(crate) fn steady<M: DamperModel, R: Real>(
    block: &Block<'_>,
    mut columns: Vec<R>,
) -> Steady<M::Parameters<R>> {
    let Block { laws, loading, .. } = *block;
    if let (false, Command::Held(command)) = (laws.are_constant(), loading.command()) {
        let mut values = vec![R::splat(f64::NAN); laws.n_params()];
        laws.evaluate(&columns, R::splat(*command), &mut values);
        columns = values;
    }
    Steady { parameters: M::Parameters::from_slice(&columns) }
}

/// The columns of `theta`, one candidate per lane. Lanes without a candidate repeat the last one.
#[inline(always)]
pub(crate) fn columns<R: Lanes>(block: &Block<'_>) -> Vec<R> {
    let Block { theta, laws, candidates, .. } = *block;
    let n_columns = laws.n_columns();
    let last = candidates.len() - 1;
    (0..n_columns)
        .map(|column| R::from_fn(|lane| theta[candidates[lane.min(last)] * n_columns + column]))
        .collect()
}

/// Simulates one block over its span with the parameters that its driver gives.
#[inline(always)]
fn run_block<M: DamperModel, R: Lanes, D: Driver<M, R>>(
    block: &Block<'_>,
    driver: &mut D,
    keep: Keep<'_, '_>,
) -> Reached {
    let Block { candidates, standings, .. } = *block;
    let last = candidates.len() - 1;
    let candidate = |lane: usize| candidates[lane.min(last)];
    let n_states = M::SPEC.n_states;
    let mut kept = Kept {
        keep,
        sum: R::from_fn(|lane| standings.sums[candidate(lane)]),
        limit: R::from_fn(|lane| standings.limits[candidate(lane)]),
    };
    let state = M::State::<R>::from_fn(|entry| {
        R::from_fn(|lane| standings.states[candidate(lane) * n_states + entry])
    });
    let (state, samples) = march::<M, R, D>(block, driver, state, &mut kept);
    let mut sums = Vec::with_capacity(R::WIDTH);
    kept.sum.for_each(|_, sum| sums.push(sum));
    let mut states = vec![0.0; R::WIDTH * n_states];
    state.for_each(|entry, values| values.for_each(|lane, value| states[lane * n_states + entry] = value));
    Reached { sums, states, samples }
}

/// Steps through the span of a block; where the states came to, and the samples simulated.
#[inline(always)]
pub(crate) fn march<M: DamperModel, R: Real, D: Driver<M, R>>(
    block: &Block<'_>,
    driver: &mut D,
    mut state: M::State<R>,
    kept: &mut impl Keeper<R>,
) -> (M::State<R>, usize) {
    let Block { loading, ref span, substeps, stop, .. } = *block;
    let fraction = 1.0 / f64::from(substeps);
    let step = loading.dt() * fraction;
    // A power of two, as both are: a mask finds its multiples without a division per sample.
    let check_every = (STEPS_PER_CHECK / substeps).max(1) as usize;
    let mut samples = 0;
    for (interval, sample) in loading.intervals()[span.start..].iter().zip(span.clone()) {
        // Before the first sample too: the blocks that a stopped batch has left return at once.
        if samples & (check_every - 1) == 0 && (stop() || kept.is_lost()) {
            break;
        }
        let mut start = interval.motion(0.0);
        driver.begin(sample);
        kept.take(sample, M::force(driver.parameters(), state, start.splat()));
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
        kept.take(loading.n_time() - 1, M::force(driver.parameters(), state, loading.last().splat()));
        samples += 1;
    }
    (state, samples)
}
