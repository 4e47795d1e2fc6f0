//! What can go wrong, by name.

use thiserror::Error;

use crate::integrate::MAX_SUBSTEP_FACTOR;

/// A call that could not be carried out.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DynamicsError {
    /// Too few samples for a cubic spline.
    #[error("a loading history has {found} samples, a cubic spline takes at least {needed}")]
    TooShort {
        /// Samples given.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
    /// Two arrays that belong together differ in length.
    #[error("`{name}` has {found} samples, the loading history has {expected}")]
    LengthMismatch {
        /// The array that differs.
        name: &'static str,
        /// Its length.
        found: usize,
        /// The length it should have.
        expected: usize,
    },
    /// A comparison that starts behind the last sample; its misfit would be zero.
    #[error("the first sample that counts is {first}, the loading history ends with sample {}", n_time - 1)]
    EmptyWindow {
        /// First sample that was to count.
        first: usize,
        /// Samples there are.
        n_time: usize,
    },
    /// A sampling step that is not a positive number.
    #[error("the sampling step is {0} s, it must be positive and finite")]
    Step(f64),
    /// An infinite or undefined sample.
    #[error("`{name}` is not finite at sample {sample}")]
    NotFinite {
        /// The array.
        name: &'static str,
        /// Index of the first such sample.
        sample: usize,
    },
    /// A parameter array of the wrong width.
    #[error("`theta` has {found} columns, `{model}` takes {expected}")]
    ParameterCount {
        /// The model.
        model: &'static str,
        /// Columns given.
        found: usize,
        /// Columns needed.
        expected: usize,
    },
    /// A derivative with respect to a column that there is not.
    #[error("column {column} of `theta` was asked for, `{model}` has {n_columns}, counted from 0")]
    NoColumn {
        /// The model.
        model: &'static str,
        /// The column asked for.
        column: usize,
        /// Columns there are.
        n_columns: usize,
    },
    /// A list of limits of the wrong length.
    #[error("{found} limits were given for {expected} candidates; give one for each")]
    LimitCount {
        /// Limits given.
        found: usize,
        /// Candidates.
        expected: usize,
    },
    /// A list of current laws of the wrong length.
    #[error("{found} current laws were given, `{model}` has {expected} parameters; give one for each")]
    LawCount {
        /// The model.
        model: &'static str,
        /// Laws given.
        found: usize,
        /// Laws needed.
        expected: usize,
    },
    /// A model that depends on the command, under a loading without one.
    #[error("`{0}` depends on the command, the loading history has none; give one value per sample")]
    NoCommand(&'static str),
    /// A sub-step factor that is not a power of two.
    #[error("the sub-step factor is {0}, it must be a power of two from 1 to {MAX_SUBSTEP_FACTOR}")]
    SubstepFactor(u32),
    /// A factor on the steps of a loop that is zero or beyond reason.
    #[error("the step factor is {0}, it must be from 1 to {MAX_SUBSTEP_FACTOR}")]
    StepFactor(u32),
    /// A matrix of the wrong size.
    #[error("`{name}` has {found} entries, expected {expected} or a multiple of as many")]
    MatrixSize {
        /// The matrix.
        name: &'static str,
        /// Its entries.
        found: usize,
        /// The entries it should have, or the entries of each of its rows.
        expected: usize,
    },
    /// A mass matrix that is not positive definite.
    #[error("the mass matrix is singular or not positive definite; give every coordinate a mass")]
    SingularMass,
    /// A ground motion without an interval.
    #[error("a ground motion has {0} samples, it takes at least two")]
    ShortMotion(usize),
    /// A run that names something there is not.
    #[error("run {run} asks for {what} {index}, there are {count}, counted from 0")]
    NoSuchEntry {
        /// The run.
        run: usize,
        /// What it asks for.
        what: &'static str,
        /// The number it asks for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A law that needs the force as a function of the command.
    #[error("the law `{0}` needs a model of the damper: the coefficients of a static_hysteretic")]
    NoCurve(&'static str),
    /// A range of commands that is none.
    #[error("the commands of device {0} end below where they begin, or are not finite")]
    CommandRange(usize),
    /// A table of a size that its law cannot read.
    #[error("table `{table}` of the law `{law}` has {found} entries; give {expected}")]
    TableSize {
        /// The law.
        law: &'static str,
        /// The table.
        table: &'static str,
        /// Its entries.
        found: usize,
        /// The entries it should have.
        expected: &'static str,
    },
    /// The caller asked to stop.
    #[error("the simulation was cancelled")]
    Cancelled,
    /// No threads to run on.
    #[error("the thread pool could not be started: {0}")]
    Threads(String),
}

/// How one candidate's simulation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Outcome {
    /// It reached the end of the record.
    Finished = 0,
    /// Its state or force left the finite numbers, or a building all bounds.
    Diverged = 1,
    /// It would need more sub-steps than [`crate::integrate::MAX_SUBSTEPS`]; it was not simulated.
    Unresolved = 2,
    /// Its misfit reached the limit it was given; it was simulated no further.
    Abandoned = 3,
    /// It reached the end, but its control law was once at a loss, as by a reading that is not a number: it sent no
    /// current then.
    FailedSafe = 4,
}
