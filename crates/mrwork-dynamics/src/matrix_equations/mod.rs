//! Riccati and Lyapunov equations of many plants and weights: gains of regulators and filters, costs, covariances.
//!
//! A batch has plants of one size; each lane solves one equation ([`pack`]), by dense matrices of lanes ([`dense`],
//! [`elimination`]). Structure-preserving doubling finds the solution ([`doubling`]), Newton's iteration refines it to
//! rounding and shows that the closed loop is stable ([`newton`]). A Lyapunov equation is a Riccati equation without
//! controls. A solution does not depend on its neighbours, the threads or the instruction set, and one that is not found is
//! a value.

mod dense;
mod doubling;
mod elimination;
mod newton;
mod pack;

use crate::dispatch::InstructionSet;
use crate::error::DynamicsError;
use crate::threads::{StopRequested, on_threads, thread_count};

use pack::PackJob;

/// Largest residual of a solution, relative to the terms of its equation in coordinates in which P is the identity.
pub const LARGEST_RESIDUAL: f64 = 1e-7;
/// Lanes of the packs; pieces of a batch are a multiple of them.
const LANES: usize = 8;
/// Pieces of a batch for each thread, so that all end at about the same time.
const PIECES: usize = 8;

/// Time of the plants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Time {
    /// `s' = A s + B f`.
    Continuous,
    /// `s_{k+1} = A s_k + B f_k`.
    Discrete,
}

/// One matrix for each row of a batch, or one for all.
#[derive(Clone, Copy, Debug)]
pub struct Stack<'a> {
    entries: &'a [f64],
    each: usize,
}

impl<'a> Stack<'a> {
    /// From row-major matrices of `each` entries.
    #[must_use]
    pub fn new(entries: &'a [f64], each: usize) -> Self {
        Self { entries, each }
    }

    /// The matrix of a row.
    #[inline(always)]
    fn of_row(&self, row: usize) -> &'a [f64] {
        let first = if self.entries.len() == self.each { 0 } else { row * self.each };
        &self.entries[first..][..self.each]
    }

    fn check(&self, name: &'static str, each: usize, n_batch: usize) -> Result<(), DynamicsError> {
        let (found, expected) = (self.entries.len(), n_batch.saturating_mul(each));
        if self.each != each || (found != each && found != expected) {
            return Err(DynamicsError::MatrixSize { name, found, expected });
        }
        match self.entries.iter().position(|entry| !entry.is_finite()) {
            Some(sample) => Err(DynamicsError::NotFinite { name, sample }),
            None => Ok(()),
        }
    }
}

/// Equations of a batch: the costs `int s'Q s + 2 s'N f + f'R f dt`, or their sums over the samples.
///
/// In continuous time `A'P + P A - (P B + N) R^-1 (B'P + N') + Q = 0`, in discrete time
/// `A'P A - P - (A'P B + N)(R + B'P B)^-1 (B'P A + N') + Q = 0`.
#[derive(Clone, Copy, Debug)]
pub struct Equations<'a> {
    /// Rows of the batch.
    pub n_batch: usize,
    /// Order of the plants, n.
    pub n_states: usize,
    /// Controls, m; none for Lyapunov equations.
    pub n_controls: usize,
    /// Continuous or discrete time.
    pub time: Time,
    /// A, n x n.
    pub state: Stack<'a>,
    /// B, n x m.
    pub control: Stack<'a>,
    /// Q, n x n, symmetric.
    pub state_weight: Stack<'a>,
    /// R, m x m, symmetric.
    pub control_weight: Stack<'a>,
    /// N, n x m; zero if absent.
    pub cross_weight: Option<Stack<'a>>,
    /// T of s = T z, n x n: coordinates in which all terms are of one magnitude; a diagonal that balances A if absent.
    pub scaling: Option<Stack<'a>>,
}

impl Equations<'_> {
    fn check(&self) -> Result<(), DynamicsError> {
        let (n, m, n_batch) = (self.n_states, self.n_controls, self.n_batch);
        if n == 0 && n_batch > 0 {
            // Without entries, nothing would bound the number of rows.
            return Err(DynamicsError::MatrixSize { name: "state", found: 0, expected: n_batch });
        }
        // No slice is as long as a product that overflows.
        let [square, oblong, effort] =
            [[n, n], [n, m], [m, m]].map(|[rows, columns]| rows.saturating_mul(columns));
        self.state.check("state", square, n_batch)?;
        self.state_weight.check("state_weight", square, n_batch)?;
        self.control.check("control", oblong, n_batch)?;
        self.control_weight.check("control_weight", effort, n_batch)?;
        if let Some(cross) = self.cross_weight {
            cross.check("cross_weight", oblong, n_batch)?;
        }
        if let Some(scaling) = self.scaling {
            scaling.check("scaling", square, n_batch)?;
        }
        Ok(())
    }
}

/// How the solution of one equation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// P has a stable closed loop and a small residual.
    Solved = 0,
    /// A mode that is not damped is not weighed or not controlled.
    NoStabilisingSolution = 1,
    /// The residual stays above [`LARGEST_RESIDUAL`].
    NotConverged = 2,
    /// R is not positive definite.
    WeightNotPositive = 3,
}

/// Residual and status of one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Relative to the terms of the equation, in coordinates in which P is the identity; infinite if there is no P.
    pub residual: f64,
    /// How it ended.
    pub status: Status,
}

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
