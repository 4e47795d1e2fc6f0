//! One block of lanes: candidates that are simulated together under one loading history.

use core::marker::PhantomData;
use core::ops::Range;

use crate::current_law::{CurrentLaws, Evaluate, Prepare};
use crate::damper::model::{DamperModel, DamperSpec, Motion, Short, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::driver::{Driver, Following, Steady};
use crate::lanes::Lanes;
use crate::loading::{Command, LoadingHistory};
use crate::misfit::{ForceAccumulator, ForceOutput, ForceSink, Target};
use crate::real::{Bits, Real};
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
    pub loading: &'a LoadingHistory<'a>,
    /// Samples to simulate.
    pub span: Range<usize>,
    /// States and sums of the batch at the start of the span.
    pub progress: &'a BatchProgress,
    /// Sub-steps per sample interval, a power of two.
    pub substeps: u32,
    /// Whether a step is a short chain of arithmetic for all candidates.
    pub short: bool,
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
    model: M,
    set: InstructionSet,
    block: &Block<'_>,
    output: ForceOutput<'_, '_>,
) -> BlockResult {
    match block.loading.command() {
        Command::Varying(command) if !block.laws.are_constant() => {
            let command = AfterCommand { laws: block.laws, command };
            set.run_narrow(OnePack { block, output, command, model })
        }
        // Narrow packs side by side: what a short step needs stays in registers.
        _ if const { matches!(M::SHORT, Short::Always) }
            || const { matches!(M::SHORT, Short::WhereTwo(_)) } && block.short =>
        {
            set.run_narrow(SideBySide { block, output, command: Constant::<true>, model })
        }
        _ => set.run(block.candidates.len(), OnePack { block, output, command: Constant::<false>, model }),
    }
}

/// A block in one pack.
struct OnePack<'a, 'b, M, C> {
    block: &'a Block<'a>,
    output: ForceOutput<'a, 'b>,
    command: C,
    model: M,
}

impl<M: DamperModel, C: OverTime<M>> LaneJob for OnePack<'_, '_, M, C> {
    type Output = BlockResult;
    type Home = M;
    #[inline(always)]
    fn run<R: Lanes + Bits>(self) -> BlockResult {
        let Self { block, output, command, model } = self;
        if const { R::WIDTH == 1 } {
            return SideBySide { block, output, command, model }.run::<R>();
        }
        let driver = command.driver::<R>(model, block, block.candidates);
        let mut pack = Integrated::new(block, block.candidates, driver, output.target, output.rows);
        let state = state_at_start::<M, R>(block, block.candidates);
        let (state, samples) = integrate_span(block, &mut pack, state);
        block_result(&[WithState { pack, state }], samples)
    }
}

/// A block in several packs side by side.
struct SideBySide<'a, 'b, M, C> {
    block: &'a Block<'a>,
    output: ForceOutput<'a, 'b>,
    command: C,
    model: M,
}

impl<M: DamperModel, C: OverTime<M>> LaneJob for SideBySide<'_, '_, M, C> {
    type Output = BlockResult;
    type Home = M;
    #[inline(always)]
    fn run<R: Lanes>(self) -> BlockResult {
        let Self { block, output, command, model } = self;
        let mut packs = Vec::with_capacity(block.candidates.len().div_ceil(R::WIDTH));
        let mut rows = output.rows.chunks_mut(R::WIDTH);
        for candidates in block.candidates.chunks(R::WIDTH) {
            let driver = command.driver::<R>(model, block, candidates);
            let rows = rows.next().unwrap_or_default();
            let pack = Integrated::new(block, candidates, driver, output.target, rows);
            packs.push(WithState { pack, state: state_at_start::<M, R>(block, candidates) });
        }
        let ((), samples) = integrate_span(block, &mut packs, ());
        block_result(&packs, samples)
    }
}

/// How the parameters of candidates run over time.
pub(crate) trait OverTime<M: DamperModel> {
    /// What provides them in each step.
    type Driver<R: Lanes>: Driver<M, R>;
    fn driver<R: Lanes>(&self, model: M, block: &Block<'_>, candidates: &[usize]) -> Self::Driver<R>;
}

/// Constant in time; every step is short with them, or not.
pub(crate) struct Constant<const SHORT: bool>;

impl<M: DamperModel, const SHORT: bool> OverTime<M> for Constant<SHORT> {
    type Driver<R: Lanes> = Steady<M::Parameters<R>, SHORT>;
    #[inline(always)]
    fn driver<R: Lanes>(&self, model: M, block: &Block<'_>, candidates: &[usize]) -> Self::Driver<R> {
        let values = steady_values(block, columns::<R>(block, candidates));
        Steady { parameters: model.parameters(&values) }
    }
}

/// After a varying command.
pub(crate) struct AfterCommand<'a> {
    pub(crate) laws: &'a CurrentLaws,
    pub(crate) command: &'a [f64],
}

impl<'a, M: DamperModel> OverTime<M> for AfterCommand<'a> {
    type Driver<R: Lanes> = Following<'a, M, R>;
    #[inline(always)]
    fn driver<R: Lanes>(&self, model: M, block: &Block<'_>, candidates: &[usize]) -> Self::Driver<R> {
        let step = block.loading.dt() / f64::from(block.substeps);
        Following::new(model, self.laws, columns(block, candidates), self.command, step)
    }
}

/// Parameters that are constant in time, from columns: those at the constant command, if there is one.
#[inline(always)]
pub(crate) fn steady_values<R: Real>(block: &Block<'_>, mut columns: Vec<R>) -> Vec<R> {
    let Block { laws, loading, .. } = *block;
    if let (false, Command::Held(command)) = (laws.are_constant(), loading.command()) {
        let mut values = vec![R::splat(f64::NAN); laws.n_params()];
        R::out_of_line(Prepare { laws, columns: &mut columns });
        R::out_of_line(Evaluate {
            laws,
            prepared: &columns,
            current: R::splat(*command),
            values: &mut values,
        });
        columns = values;
    }
    columns
}

/// The columns of `theta`, one candidate per lane. Excess lanes repeat the last candidate.
#[inline(always)]
pub(crate) fn columns<R: Lanes>(block: &Block<'_>, candidates: &[usize]) -> Vec<R> {
    let Block { theta, laws, .. } = *block;
    let n_columns = laws.n_columns();
    let last = candidates.len() - 1;
    let mut columns = Vec::with_capacity(n_columns);
    for column in 0..n_columns {
        columns.push(R::from_fn(|lane| theta[candidates[lane.min(last)] * n_columns + column]));
    }
    columns
}

/// States at the start of the span; excess lanes repeat the last candidate.
#[inline(always)]
fn state_at_start<M: DamperModel, R: Lanes>(block: &Block<'_>, candidates: &[usize]) -> M::State<R> {
    let (states, n, last) = (&block.progress.states, M::SPEC.n_states, candidates.len() - 1);
    M::State::<R>::from_fn(|number| R::from_fn(|lane| states[candidates[lane.min(last)] * n + number]))
}

/// A pack of candidates during a span, apart from their states.
pub(crate) struct Integrated<M: DamperModel, R: Real, D, S> {
    pub(crate) driver: D,
    pub(crate) sink: S,
    pub(crate) kind: PhantomData<(M, R)>,
}

impl<'a, 'b, M: DamperModel, R: Lanes, D> Integrated<M, R, D, ForceAccumulator<'a, 'b, R>> {
    /// Sums as they were at the start of the span; excess lanes repeat the last candidate.
    #[inline(always)]
    fn new(
        block: &Block<'_>,
        candidates: &[usize],
        driver: D,
        target: Option<Target<'a>>,
        rows: &'a mut [&'b mut [f64]],
    ) -> Self {
        let (progress, last) = (block.progress, candidates.len() - 1);
        let sum = R::from_fn(|lane| progress.sums[candidates[lane.min(last)]]);
        let limit = R::from_fn(|lane| progress.limits[candidates[lane.min(last)]]);
        Self { driver, sink: ForceAccumulator { target, rows, sum, limit }, kind: PhantomData }
    }
}

/// Sums and states of packs.
#[inline(always)]
fn block_result<M: DamperModel, R: Lanes, D>(
    packs: &[Summed<'_, '_, M, R, D>],
    samples: usize,
) -> BlockResult {
    let n_states = M::SPEC.n_states;
    let mut sums = Vec::with_capacity(packs.len() * R::WIDTH);
    let mut states = vec![0.0; packs.len() * R::WIDTH * n_states];
    for (number, WithState { pack, state }) in packs.iter().enumerate() {
        let first = number * R::WIDTH;
        state.for_each(|entry, values| {
            values.for_each(|lane, value| states[(first + lane) * n_states + entry] = value);
        });
        pack.sink.sum.for_each(|_, sum| sums.push(sum));
    }
    BlockResult { sums, states, samples }
}

/// A pack and its states.
pub(crate) struct WithState<P, S> {
    pub(crate) pack: P,
    pub(crate) state: S,
}

/// A pack that has summed its residuals.
type Summed<'a, 'b, M, R, D> =
    WithState<Integrated<M, R, D, ForceAccumulator<'a, 'b, R>>, <M as DamperModel>::State<R>>;

/// One pack, whose states are a value apart and stay where a step leaves them, or several side by side with theirs.
pub(crate) trait Packs {
    /// The states of a single pack.
    type State;
    /// Whether each pack takes the force at a sample together with the step that begins there: it then meets its state once.
    const TAKES_WITH_STEP: bool;
    /// Takes the force at a sample, with the command that begins there.
    fn take(&mut self, sample: usize, state: &Self::State, motion: Motion<f64>);
    /// The state after a step, whose motions are given at its start, middle and end; takes the force of a sample that
    /// begins with it.
    fn advance(
        &mut self,
        begins: Option<usize>,
        state: Self::State,
        motions: [Motion<f64>; 3],
        step: f64,
    ) -> Self::State;
    /// Whether later samples cannot change the result.
    fn is_settled(&self) -> bool;
}

impl<M: DamperModel, R: Real, D: Driver<M, R>, S: ForceSink<M, R, D>> Packs for Integrated<M, R, D, S> {
    type State = M::State<R>;
    const TAKES_WITH_STEP: bool = false;

    #[inline(always)]
    fn take(&mut self, sample: usize, state: &M::State<R>, motion: Motion<f64>) {
        self.driver.begin(sample);
        self.sink.take(sample, &self.driver, *state, motion.splat());
    }

    #[inline(always)]
    fn advance(
        &mut self,
        begins: Option<usize>,
        state: M::State<R>,
        motions: [Motion<f64>; 3],
        step: f64,
    ) -> M::State<R> {
        if let Some(sample) = begins {
            self.take(sample, &state, motions[0]);
        }
        let parameters = self.driver.step();
        match (M::SPEC.n_states, D::SHORT) {
            (0, _) => state,
            (_, true) => M::step::<R, f64, true>(parameters, state, motions, step),
            (_, false) => M::step::<R, f64, false>(parameters, state, motions, step),
        }
    }

    #[inline(always)]
    fn is_settled(&self) -> bool {
        self.sink.is_settled()
    }
}

impl<P: Packs<State: Copy>> Packs for Vec<WithState<P, P::State>> {
    type State = ();
    const TAKES_WITH_STEP: bool = true;

    #[inline(always)]
    fn take(&mut self, sample: usize, (): &(), motion: Motion<f64>) {
        for WithState { pack, state } in self {
            pack.take(sample, state, motion);
        }
    }

    #[inline(always)]
    fn advance(&mut self, begins: Option<usize>, (): (), motions: [Motion<f64>; 3], step: f64) {
        for WithState { pack, state } in self {
            *state = pack.advance(begins, *state, motions, step);
        }
    }

    #[inline(always)]
    fn is_settled(&self) -> bool {
        let mut settled = true;
        for WithState { pack, .. } in self {
            settled &= pack.is_settled();
        }
        settled
    }
}

/// Integrates packs over the span of a block; returns their states at its end and the number of samples simulated.
#[inline(always)]
pub(crate) fn integrate_span<P: Packs>(
    block: &Block<'_>,
    packs: &mut P,
    mut state: P::State,
) -> (P::State, usize) {
    let Block { loading, ref span, substeps, stop, .. } = *block;
    let fraction = 1.0 / f64::from(substeps);
    let step = loading.dt() * fraction;
    // A power of two, as both factors are: a mask finds its multiples without a division per sample.
    let check_every = (STEPS_PER_CHECK / substeps).max(1) as usize;
    let mut samples = 0;
    for (interval, sample) in loading.intervals_from(span.start).zip(span.clone()) {
        // Checked before the first sample too, so that the remaining blocks of a cancelled batch return at once.
        if samples & (check_every - 1) == 0 && (stop() || packs.is_settled()) {
            break;
        }
        let mut start = interval.motion(0.0);
        if !P::TAKES_WITH_STEP {
            packs.take(sample, &state, start);
        }
        for substep in 0..substeps {
            let begins = (P::TAKES_WITH_STEP && substep == 0).then_some(sample);
            let u = f64::from(substep) * fraction;
            let middle = interval.motion(u + 0.5 * fraction);
            let end = interval.motion(u + fraction);
            state = packs.advance(begins, state, [start, middle, end], step);
            start = end;
        }
        samples += 1;
    }
    if span.start + samples == loading.n_time() - 1 && span.end == loading.n_time() {
        packs.take(loading.n_time() - 1, &state, loading.last());
        samples += 1;
    }
    (state, samples)
}
