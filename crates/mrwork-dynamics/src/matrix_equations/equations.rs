//! Equations of a batch and their solutions: what is given, checked, and what is told of each row.

use crate::error::DynamicsError;

/// Largest residual of a solution, relative to the terms of its equation in coordinates in which P is the identity.
pub const LARGEST_RESIDUAL: f64 = 1e-7;

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
    pub(super) fn of_row(&self, row: usize) -> &'a [f64] {
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
    pub(super) fn check(&self) -> Result<(), DynamicsError> {
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
