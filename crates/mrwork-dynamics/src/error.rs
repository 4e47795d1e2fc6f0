//! Errors of a call, and outcomes of single simulations. Depends on no other module.

use thiserror::Error;

/// An error that ends a call.
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
    /// A comparison window without samples; its misfit would be zero.
    #[error("the first sample that counts is {first}, the loading history ends with sample {}", n_time - 1)]
    EmptyWindow {
        /// First sample of the window.
        first: usize,
        /// Samples of the loading history.
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
    /// A derivative with respect to a column that does not exist.
    #[error("column {column} of `theta` was asked for, `{model}` has {n_columns}, counted from 0")]
    NoColumn {
        /// The model.
        model: &'static str,
        /// The column.
        column: usize,
        /// Number of columns.
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
    /// A lag with more rates than a driver has.
    #[error("the lag of the driver has {0} rates; give 0, 1 or 2")]
    LagRates(usize),
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
    /// A name that is none of a current law.
    #[error(
        "no current law is called {0:?}; there are constant, linear, quadratic, cubic, exponential, and those by values \
         at rising commands, as in quadratic:0,0.5,1, log_quadratic:0,0.5,1, monotone:0,0.5,1, straight:0,0.5,1, \
         straight_log:0,0.5,1, exponential:0,1 or tanh:0,1"
    )]
    UnknownLaw(String),
    /// A damper that is no model of the registry, as the device of a loop.
    #[error("`{0}` is no registered damper model; a loop takes those of the registry")]
    UnknownDevice(&'static str),
    /// Formulas of a damper of a user that cannot be walked.
    #[error(
        "the formulas of {0} are damaged: a tape is unsound, or has other inputs or results than the damper"
    )]
    OwnDamper(String),
    /// A formula of a user that does more than arithmetic on its own numbers.
    #[error(
        "the tape of a formula is damaged: it reads what it has not written, or is larger than any that is recorded; record \
         its function again"
    )]
    UnsoundTape,
    /// A law whose command jumps, with derivatives.
    #[error("`{0}` switches, so that its results have no derivatives")]
    Switches(&'static str),
    /// A model that depends on the command, with a loading history that has none.
    #[error("`{0}` depends on the command, the loading history has none; give one value per sample")]
    NoCommand(&'static str),
    /// A fixed number of sub-steps that is not a power of two.
    #[error("the number of sub-steps is {found}, it must be a power of two from 1 to {most}")]
    Substeps {
        /// The number given.
        found: u32,
        /// Largest admissible number.
        most: u32,
    },
    /// A sub-step factor that is not a power of two.
    #[error("the sub-step factor is {found}, it must be a power of two from 1 to {most}")]
    SubstepFactor {
        /// The factor given.
        found: u32,
        /// Largest admissible factor.
        most: u32,
    },
    /// A step factor of a closed loop that is zero or too large.
    #[error("the step factor is {found}, it must be from 1 to {most}")]
    StepFactor {
        /// The factor given.
        found: u32,
        /// Largest admissible factor.
        most: u32,
    },
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
    /// A setting beyond its largest admissible value.
    #[error("`{name}` is {found}, give at most {most}")]
    TooLarge {
        /// The setting.
        name: &'static str,
        /// The value given.
        found: usize,
        /// Largest admissible value.
        most: usize,
    },
    /// A mass matrix that is not positive definite.
    #[error("the mass matrix is singular or not positive definite; give every coordinate a mass")]
    SingularMass,
    /// A ground motion without an interval.
    #[error("a ground motion has {0} samples, it takes at least two")]
    ShortMotion(usize),
    /// A run that refers to an entry that does not exist.
    #[error("run {run} asks for {what} {index}, there are {count}, counted from 0")]
    NoSuchEntry {
        /// The run.
        run: usize,
        /// Kind of entry.
        what: &'static str,
        /// Index of the entry.
        index: usize,
        /// Number of entries.
        count: usize,
    },
    /// A control law that needs a damper model, without one.
    #[error("the law `{0}` needs a model of the damper: the coefficients of a static_hysteretic")]
    NoCurve(&'static str),
    /// A law that reads accelerations, for a device that is not between floors or floor and ground.
    #[error("the law `{0}` reads accelerations at the ends of each device; attach the devices to floors")]
    NoAcceleration(&'static str),
    /// Shears of storeys from floors that are no coordinates.
    #[error(
        "the law `{0}` works out what its model misses from accelerations of floors, which are not the coordinates of this \
         building; leave `shear_offsets` and `adaptation` out"
    )]
    NoShears(&'static str),
    /// An adaptation of yield drifts of a model that has none.
    #[error(
        "the law `{0}` adapts the yield drifts of storeys, and its model is no chain of floors with storeys that yield; \
         leave `adaptation` out, or give `model` as the building where its storeys yield"
    )]
    NothingYields(&'static str),
    /// A dead zone or a slope that no command can have.
    #[error(
        "candidate {0}, counted from 0, has a dead zone that is negative or not finite, or a slope that is not positive"
    )]
    Shaping(usize),
    /// A preview of the ground acceleration that is no time.
    #[error("the ground is previewed for {0} s; give a time of zero or more")]
    Preview(f64),
    /// A control law that needs a model of the loop, without one.
    #[error("the law `{0}` needs a model of the loop: a building and its dampers")]
    NoModel(&'static str),
    /// A time of a decision that is not a whole number of control samples.
    #[error(
        "`{law}` decides every {hold} s, which is not a whole number of control samples of {sample_time} s; give a multiple of them"
    )]
    Decision {
        /// The law.
        law: &'static str,
        /// Time of a decision [s].
        hold: f64,
        /// Sampling interval [s].
        sample_time: f64,
    },
    /// A step of the controller's model that its equations do not allow.
    #[error(
        "the model of `{law}` is stable with steps of up to {needed:.2e} s, and is to take steps of {step:.2e} s; give a \
         finer `step`, down to {shortest:.2e} s, or a model of dampers that are less stiff, as their static counterpart"
    )]
    ModelStep {
        /// The law.
        law: &'static str,
        /// The step that was to be taken [s].
        step: f64,
        /// The longest stable one [s].
        needed: f64,
        /// The shortest that is admitted [s].
        shortest: f64,
    },
    /// A range of commands that is empty or not finite.
    #[error("the commands of device {0} end below where they begin, or are not finite")]
    CommandRange(usize),
    /// An element with a number that it cannot have.
    #[error(
        "element {0}, counted from 0, has a number that is not finite or negative, a slope that is not positive or a \
         sharpness below 1"
    )]
    Element(usize),
    /// A table of the wrong size.
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
    /// A build of other instruction sets than this processor has.
    #[error(
        "this build of mrwork is for processors with {}, and this one has {}; build mrwork again on this machine with \
         MRWORK_BUILD_SETS={} in the environment, or with MRWORK_BUILD_SETS=all for every processor (by make demo in a clone, \
         else by pip install --force-reinstall --no-cache-dir)",
        of_build.join(" or "), of_processor.join(" and "), of_processor.first().copied().unwrap_or("all")
    )]
    Processor {
        /// Names of the instruction sets of the build.
        of_build: Vec<&'static str>,
        /// Names of those of the processor, fastest first.
        of_processor: Vec<&'static str>,
    },
    /// The caller cancelled.
    #[error("the simulation was cancelled")]
    Cancelled,
    /// No threads to run on.
    #[error("the thread pool could not be started: {0}")]
    Threads(String),
}

/// How the simulation of one candidate or run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Outcome {
    /// It reached the end of the record.
    Finished = 0,
    /// A state, force or floor displacement grew without bound.
    Diverged = 1,
    /// It needs more sub-steps than are admitted; it was not simulated.
    Unresolved = 2,
    /// Its misfit reached its limit; the simulation stopped there.
    Abandoned = 3,
    /// It reached the end, but at least one command was not a number (for example after a reading that is not a
    /// number); zero was sent instead.
    FailedSafe = 4,
}
