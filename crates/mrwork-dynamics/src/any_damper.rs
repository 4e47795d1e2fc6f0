//! A damper model behind a pointer: what a batch asks of it, whichever it is.

use crate::block::{self, Block, Reached};
use crate::closed_loop;
use crate::current_law::CurrentLaws;
use crate::damper::{DamperModel, DamperSpec, Motion, Severity, State};
use crate::dispatch::InstructionSet;
use crate::integrate::{stiffness_bound, substeps};
use crate::loading::LoadingHistory;
use crate::misfit::{Keep, Target};
use crate::parameters::FromSlice;
use crate::sensitivity::{self, LaneRows, Seed};

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
    /// Bound of the fastest relaxation of the states [1/s] at the stiffest of these commands; not a finite number where
    /// the states have no bound.
    fn stiffness_bound(&self, theta: &[f64], laws: &CurrentLaws, commands: &[f64], severity: Severity)
    -> f64;
    /// Time derivative of the states.
    fn rate(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> Vec<f64>;
    /// Force [N].
    fn force(&self, theta: &[f64], state: &[f64], motion: Motion<f64>) -> f64;
    /// Arithmetic operations of one step and one residual, a fused multiply-add counted as two.
    fn flops_per_step(&self, theta: &[f64]) -> u64;
    /// Goes on with the sums of squared residuals against a measured force.
    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> Reached;
    /// Force histories, one row per candidate of the block.
    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]);
    /// Force histories and their derivatives along the seeds, one seed and one set of rows per lane.
    fn sensitivities(
        &self,
        set: InstructionSet,
        block: &Block<'_>,
        seeds: &[Seed],
        rows: &mut [LaneRows<'_>],
    );
    /// Runs a block of buildings that carry such dampers.
    fn respond(
        &self,
        set: InstructionSet,
        block: &closed_loop::Block<'_>,
        histories: &mut [closed_loop::History<'_>],
    ) -> Vec<closed_loop::Left>;
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

    fn squared_errors(&self, set: InstructionSet, block: &Block<'_>, target: Target<'_>) -> Reached {
        block::run::<M>(set, block, Keep { target: Some(target), rows: &mut [] })
    }

    fn histories(&self, set: InstructionSet, block: &Block<'_>, rows: &mut [&mut [f64]]) {
        block::run::<M>(set, block, Keep { target: None, rows });
    }

    fn sensitivities(
        &self,
        set: InstructionSet,
        block: &Block<'_>,
        seeds: &[Seed],
        rows: &mut [LaneRows<'_>],
    ) {
        sensitivity::run::<M>(set, block, seeds, rows);
    }

    fn respond(
        &self,
        set: InstructionSet,
        block: &closed_loop::Block<'_>,
        histories: &mut [closed_loop::History<'_>],
    ) -> Vec<closed_loop::Left> {
        closed_loop::run_block::<M>(set, block, histories)
    }
}

fn at_point<M: DamperModel>(theta: &[f64], state: &[f64]) -> (M::Parameters<f64>, M::State<f64>) {
    let entry = |index: usize| state.get(index).copied().unwrap_or(f64::NAN);
    (M::Parameters::from_slice(theta), M::State::from_fn(entry))
}
