//! A damper model as a trait object: the interface that batches use.

use crate::block::{self, Block, BlockResult};
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, DamperSpec, Motion, Severity, Short, State};
use crate::dispatch::InstructionSet;
use crate::dual_block::{self, LaneRows, LaneSeeds};
use crate::integrate::{stiffness_bound, substeps};
use crate::loading::LoadingHistory;
use crate::misfit::{ForceOutput, Target};
use crate::parameters::FromSlice;

/// A damper model as a trait object: whole blocks and single evaluations; no dynamic dispatch within a time step.
pub trait Damper: Sync {
    /// Description of the model.
    fn spec(&self) -> &'static DamperSpec;
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

    fn stiffness_bound(
        &self,
        theta: &[f64],
        laws: &CurrentLaws,
        commands: &[f64],
        severity: Severity,
    ) -> f64 {
        stiffness_bound::<M>(theta, laws, commands, severity)
    }

    fn has_short_step(&self, theta: &[f64], laws: &CurrentLaws) -> bool {
        match M::SHORT {
            Short::Never => false,
            Short::Always => true,
            Short::WhereTwo(exponent) => laws.constant_value(theta, exponent) == Some(2.0),
        }
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

    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> BlockResult {
        block::run::<M>(set, block, ForceOutput { target: Some(target), rows: &mut [] })
    }

    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]) {
        block::run::<M>(set, block, ForceOutput { target: None, rows });
    }

    fn sensitivities(
        &self,
        set: InstructionSet,
        block: &Block<'_>,
        seeds: &[LaneSeeds],
        rows: &mut [LaneRows<'_>],
        plain_states: bool,
    ) {
        dual_block::run::<M>(set, block, seeds, rows, plain_states);
    }
}

fn at_point<M: DamperModel>(theta: &[f64], state: &[f64]) -> (M::Parameters<f64>, M::State<f64>) {
    let entry = |index: usize| state.get(index).copied().unwrap_or(f64::NAN);
    (M::Parameters::from_slice(theta), M::State::from_fn(entry))
}
