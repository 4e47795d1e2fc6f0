//! A damper model as a trait object: the interface that batches use.

use crate::block::{self, Block, BlockResult};
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, DamperSpec, Motion, Severity, Short, State};
use crate::dispatch::InstructionSet;
use crate::dual_block::{self, LaneRows, LaneSeeds};
use crate::integrate::{stiffness_bound, substeps};
use crate::loading::LoadingHistory;
use crate::misfit::{ForceOutput, Target};
use crate::watch;

/// A damper model as a trait object: whole blocks and single evaluations; no dynamic dispatch within a time step.
pub trait Damper: Sync {
    /// Description of the model.
    fn spec(&self) -> &'static DamperSpec;
    /// Number of states.
    fn n_states(&self) -> usize;
    /// Sub-steps per sample interval; `None` if the candidate needs more than are admitted.
    fn substeps(
        &self,
        theta: &[f64],
        laws: &CurrentLaws,
        loading: &LoadingHistory,
        factor: u32,
    ) -> Option<u32>;
    /// Upper bound of the fastest relaxation rate of the states [1/s] over these commands; not finite if unbounded.
    fn stiffness_bound(&self, theta: &[f64], laws: &CurrentLaws, commands: &[f64], severity: Severity)
    -> f64;
    /// Whether sub-steps follow from the relaxation along each motion, see [`Self::fastest`].
    fn is_watched(&self) -> bool;
    /// Whether the motion alone decides how fast the states relax.
    fn relaxes_by_motion(&self) -> bool;
    /// Fastest relaxation of the states of each candidate over the record [1/s], of a model that is watched.
    fn fastest(&self, set: InstructionSet, block: &Block<'_>) -> Vec<f64>;
    /// Whether a step of a candidate is a short chain of arithmetic.
    fn has_short_step(&self, theta: &[f64], laws: &CurrentLaws) -> bool;
    /// Time derivative of the states.
    fn rate(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> Vec<f64>;
    /// Force [N].
    fn force(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> f64;
    /// Arithmetic operations of one step and one residual; a fused multiply-add counts as two.
    fn flops_per_step(&self, theta: &[f64]) -> u64;
    /// Sums of squared residuals against a measured force, continued from the start of the block's span.
    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> BlockResult;
    /// Force histories, one row per candidate of the block.
    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]);
    /// Force histories and their derivatives, one seed and one set of rows per lane, see [`dual_block::run`].
    fn sensitivities(
        &self,
        set: InstructionSet,
        block: &Block<'_>,
        seeds: &[LaneSeeds],
        rows: &mut [LaneRows<'_>],
        plain_states: bool,
    );
}

impl<M: DamperModel> Damper for M {
    fn spec(&self) -> &'static DamperSpec {
        self.description()
    }

    fn n_states(&self) -> usize {
        DamperModel::n_states(*self)
    }

    fn substeps(
        &self,
        theta: &[f64],
        laws: &CurrentLaws,
        loading: &LoadingHistory,
        factor: u32,
    ) -> Option<u32> {
        substeps(*self, theta, laws, loading, factor)
    }

    fn stiffness_bound(
        &self,
        theta: &[f64],
        laws: &CurrentLaws,
        commands: &[f64],
        severity: Severity,
    ) -> f64 {
        stiffness_bound(*self, theta, laws, commands, severity)
    }

    fn is_watched(&self) -> bool {
        M::WATCHED
    }

    fn relaxes_by_motion(&self) -> bool {
        DamperModel::relaxes_by_motion(*self)
    }

    fn fastest(&self, set: InstructionSet, block: &Block<'_>) -> Vec<f64> {
        if const { M::WATCHED } { watch::run(*self, set, block) } else { vec![0.0; block.candidates.len()] }
    }

    fn has_short_step(&self, theta: &[f64], laws: &CurrentLaws) -> bool {
        match M::SHORT {
            Short::Never => false,
            Short::Always => true,
            Short::WhereTwo(exponent) => laws.constant_value(theta, exponent) == Some(2.0),
        }
    }

    fn rate(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> Vec<f64> {
        let (p, state) = at_point(*self, theta, state);
        let mut rate = Vec::with_capacity(M::SPEC.n_states);
        M::rate(&p, state, motion).for_each(|_, value| rate.push(value));
        rate.truncate(Damper::n_states(self));
        rate
    }

    fn force(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> f64 {
        let (p, state) = at_point(*self, theta, state);
        M::force(&p, state, motion)
    }

    fn flops_per_step(&self, theta: &[f64]) -> u64 {
        crate::peak::flops_per_step(*self, theta)
    }

    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> BlockResult {
        block::run(*self, set, block, ForceOutput { target: Some(target), rows: &mut [] })
    }

    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]) {
        block::run(*self, set, block, ForceOutput { target: None, rows });
    }

    fn sensitivities(
        &self,
        set: InstructionSet,
        block: &Block<'_>,
        seeds: &[LaneSeeds],
        rows: &mut [LaneRows<'_>],
        plain_states: bool,
    ) {
        dual_block::run(*self, set, block, seeds, rows, plain_states);
    }
}

fn at_point<M: DamperModel>(model: M, theta: &[f64], state: &[f64]) -> (M::Parameters<f64>, M::State<f64>) {
    let entry = |index: usize| state.get(index).copied().unwrap_or(f64::NAN);
    (model.parameters(theta), M::State::from_fn(entry))
}
