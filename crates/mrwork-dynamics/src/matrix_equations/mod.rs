//! Riccati and Lyapunov equations of many plants and weights: gains of regulators and filters, costs, covariances.
//!
//! A batch has plants of one size ([`equations`]); each lane solves one equation ([`pack`]), by dense matrices of lanes
//! ([`dense`], [`elimination`]). Structure-preserving doubling finds the solution ([`doubling`]), Newton's iteration
//! refines it to rounding and shows that the closed loop is stable ([`newton`]). A Lyapunov equation is a Riccati equation
//! without controls. A solution does not depend on its neighbours, the threads or the instruction set, and one that is not
//! found is a value.

mod dense;
mod doubling;
mod elimination;
mod equations;
mod newton;
mod pack;

pub use equations::{Equations, LARGEST_RESIDUAL, Solution, Stack, Status, Time};
use pack::PackJob;

use crate::dispatch::InstructionSet;
use crate::error::DynamicsError;
use crate::threads::{StopRequested, on_threads, thread_count};

/// Lanes of the packs; pieces of a batch are a multiple of them.
const LANES: usize = 8;
/// Pieces of a batch for each thread, so that all end at about the same time.
const PIECES: usize = 8;

/// Solves every equation: K of `f = -K s` into `gain`, shape (`n_batch`, m, n), and P into `riccati`, shape
/// (`n_batch`, n, n); both are infinite in a row that is not solved.
///
/// # Errors
/// If shapes do not match, an entry is not finite, or the batch was cancelled.
pub fn solve(
    equations: &Equations<'_>,
    gain: &mut [f64],
    riccati: &mut [f64],
    threads: usize,
    instruction_set: InstructionSet,
    stop: &StopRequested<'_>,
) -> Result<Vec<Solution>, DynamicsError> {
    equations.check()?;
    let (n, m, n_batch) = (equations.n_states, equations.n_controls, equations.n_batch);
    check_length("gain", gain.len(), n_batch.saturating_mul(n).saturating_mul(m))?;
    check_length("riccati", riccati.len(), n_batch.saturating_mul(n).saturating_mul(n))?;
    let unsolved = Solution { residual: f64::INFINITY, status: Status::NoStabilisingSolution };
    let mut solutions = vec![unsolved; n_batch];
    if n_batch == 0 {
        return Ok(solutions);
    }
    let threads = thread_count(threads);
    let piece = n_batch.div_ceil(threads * PIECES).next_multiple_of(LANES);
    let mut gains = gain.chunks_mut(piece * (n * m).max(1));
    let work: Vec<_> = solutions
        .chunks_mut(piece)
        .zip(riccati.chunks_mut(piece * n * n))
        .enumerate()
        .map(|(index, (solutions, riccati))| PackJob {
            equations,
            first: index * piece,
            gain: gains.next().unwrap_or_default(),
            riccati,
            solutions,
            stop,
        })
        .collect();
    on_threads(threads, work, |job| instruction_set.run_narrow(job))?;
    if stop() { Err(DynamicsError::Cancelled) } else { Ok(solutions) }
}

fn check_length(name: &'static str, found: usize, expected: usize) -> Result<(), DynamicsError> {
    if found == expected { Ok(()) } else { Err(DynamicsError::MatrixSize { name, found, expected }) }
}
