//! Loading history of a damper: displacement and velocity on a uniform grid, with cubic splines.

use std::borrow::Cow;

use crate::damper::model::{Motion, Severity};
use crate::error::DynamicsError;

/// Fewest samples of a loading history, as the not-a-knot spline requires.
pub const MIN_SAMPLES: usize = 4;

/// Most sub-steps per sample interval of a candidate.
///
/// Fits to measured tests at 100 to 1000 Hz take 1 to 64; a candidate far beyond would only delay a search.
pub const MAX_SUBSTEPS: u32 = 256;

/// Coefficients of a cubic in `u` from 0 to 1 over one sample interval, lowest power first.
type Cubic = [f64; 4];

/// Coefficients of the cubics of displacement and velocity over one sample interval, one after the other.
pub type Coefficients = [f64; 8];

/// Displacement and velocity between two samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval {
    displacement: Cubic,
    velocity: Cubic,
}

impl Interval {
    #[inline(always)]
    fn of(&[x0, x1, x2, x3, v0, v1, v2, v3]: &Coefficients) -> Self {
        Self { displacement: [x0, x1, x2, x3], velocity: [v0, v1, v2, v3] }
    }

    /// Motion at the fraction `u` of the interval.
    #[inline(always)]
    pub(crate) fn motion(&self, u: f64) -> Motion<f64> {
        Motion { displacement: evaluate(&self.displacement, u), velocity: evaluate(&self.velocity, u) }
    }
}

#[inline(always)]
fn evaluate(&[a, b, c, d]: &Cubic, u: f64) -> f64 {
    u.mul_add(u.mul_add(u.mul_add(d, c), b), a)
}

/// Command to the driver [A or V].
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Constant; not a number if none was given.
    Held(f64),
    /// One value per sample, held until the next.
    Varying(Vec<f64>),
}

/// Number of commands in the range at which the stiffness bound is evaluated.
const COMMAND_LEVELS: u32 = 9;

/// Displacement and velocity on a uniform grid with their C2 cubic splines, shared by all candidates.
#[derive(Clone, Debug)]
pub struct LoadingHistory<'a> {
    dt: f64,
    intervals: Cow<'a, [Coefficients]>,
    last: Motion<f64>,
    severity: Severity,
    command: Command,
    command_levels: Vec<f64>,
    substeps: Option<u32>,
}

impl<'a> LoadingHistory<'a> {
    /// Interpolates `displacement` [m] and `velocity` [m/s], sampled every `dt` [s].
    ///
    /// Without a velocity the derivative of the displacement spline is used, so that both are consistent.
    ///
    /// # Errors
    /// If the arrays are too short, differ in length, or contain a value that is not finite.
    pub fn new(dt: f64, displacement: &[f64], velocity: Option<&[f64]>) -> Result<Self, DynamicsError> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(DynamicsError::Step(dt));
        }
        let n_time = displacement.len();
        if n_time < MIN_SAMPLES {
            return Err(DynamicsError::TooShort { found: n_time, needed: MIN_SAMPLES });
        }
        check("displacement", displacement, n_time)?;
        let x = spline(displacement);
        let v = match velocity {
            Some(velocity) => {
                check("velocity", velocity, n_time)?;
                spline(velocity)
            }
            None => x.iter().map(|&[_, b, c, d]| [b / dt, 2.0 * c / dt, 3.0 * d / dt, 0.0]).collect(),
        };
        let intervals: Vec<Coefficients> = x
            .into_iter()
            .zip(v)
            .map(|([x0, x1, x2, x3], [v0, v1, v2, v3])| [x0, x1, x2, x3, v0, v1, v2, v3])
            .collect();
        let end = |interval: &Coefficients| Interval::of(interval).motion(1.0);
        let mut last = intervals.last().map_or(Motion { displacement: 0.0, velocity: 0.0 }, end);
        if let (Some(&x), Some(&v)) = (displacement.last(), velocity.and_then(<[f64]>::last)) {
            last = Motion { displacement: x, velocity: v };
        }
        let severity = severity(dt, &intervals);
        Ok(Self::from_parts(dt, Cow::Owned(intervals), last, severity))
    }

    /// The history that another one has these parts of; it has no command.
    #[must_use]
    pub fn from_parts(
        dt: f64,
        intervals: Cow<'a, [Coefficients]>,
        last: Motion<f64>,
        severity: Severity,
    ) -> Self {
        let (command, command_levels) = (Command::Held(f64::NAN), vec![f64::NAN]);
        Self { dt, intervals, last, severity, command, command_levels, substeps: None }
    }

    /// The same motion with a number of sub-steps per sample interval for every candidate, whatever its stiffness.
    ///
    /// # Errors
    /// If the number is no power of two, or too large.
    pub fn with_substeps(self, substeps: u32) -> Result<Self, DynamicsError> {
        if !(substeps.is_power_of_two() && substeps <= MAX_SUBSTEPS) {
            return Err(DynamicsError::Substeps { found: substeps, most: MAX_SUBSTEPS });
        }
        Ok(Self { substeps: Some(substeps), ..self })
    }

    /// Sub-steps of every candidate, where they do not follow from its stiffness.
    pub(crate) fn substeps(&self) -> Option<u32> {
        self.substeps
    }

    /// The same motion under a command [A or V], one value per sample, each held until the next.
    ///
    /// # Errors
    /// If the array differs in length or contains a value that is not finite.
    pub fn with_command(self, command: &[f64]) -> Result<Self, DynamicsError> {
        check("command", command, self.n_time())?;
        let lowest = command.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = command.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if lowest < highest {
            let spacing = (highest - lowest) / f64::from(COMMAND_LEVELS - 1);
            let levels = (0..COMMAND_LEVELS).map(|level| f64::from(level).mul_add(spacing, lowest));
            let command_levels = levels.collect();
            Ok(Self { command: Command::Varying(command.to_vec()), command_levels, ..self })
        } else {
            Ok(Self { command: Command::Held(lowest), command_levels: vec![lowest], ..self })
        }
    }

    /// Command to the driver.
    #[must_use]
    pub fn command(&self) -> &Command {
        &self.command
    }

    /// Commands at which the stiffness bound is evaluated.
    pub(crate) fn command_levels(&self) -> &[f64] {
        &self.command_levels
    }

    /// Number of samples.
    #[must_use]
    pub fn n_time(&self) -> usize {
        self.intervals.len() + 1
    }

    /// Sampling step [s].
    #[must_use]
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Quantities on which the stiffness of a model depends.
    #[must_use]
    pub fn severity(&self) -> Severity {
        self.severity
    }

    /// Coefficients of the splines, one entry per sample interval.
    #[must_use]
    pub fn coefficients(&self) -> &[Coefficients] {
        &self.intervals
    }

    /// The sample intervals from one on.
    #[inline(always)]
    pub(crate) fn intervals_from(&self, first: usize) -> impl Iterator<Item = Interval> {
        self.intervals[first..].iter().map(Interval::of)
    }

    /// Motion at the last sample.
    #[must_use]
    pub fn last(&self) -> Motion<f64> {
        self.last
    }

    /// Motion at the stage times of `substeps` Runge-Kutta steps per interval: `2 substeps + 1` equally spaced motions per
    /// interval, both ends included.
    #[must_use]
    pub fn stages(&self, substeps: u32) -> Vec<Motion<f64>> {
        let halves = 2 * substeps;
        self.intervals_from(0)
            .flat_map(|interval| {
                (0..=halves).map(move |half| interval.motion(f64::from(half) / f64::from(halves)))
            })
            .collect()
    }
}

fn severity(dt: f64, intervals: &[Coefficients]) -> Severity {
    let mut severity = Severity { peak_velocity: 0.0, reversal_acceleration: 0.0 };
    for interval in intervals.iter().map(Interval::of) {
        // The middle is a stage of the integrator too, so a peak between samples counts.
        let [start, middle, end] = [0.0, 0.5, 1.0].map(|u| interval.motion(u).velocity);
        let peak = start.abs().max(middle.abs()).max(end.abs());
        severity.peak_velocity = severity.peak_velocity.max(peak);
        if start * end <= 0.0 {
            let acceleration = (end - start).abs() / dt;
            severity.reversal_acceleration = severity.reversal_acceleration.max(acceleration);
        }
    }
    severity
}

fn check(name: &'static str, samples: &[f64], expected: usize) -> Result<(), DynamicsError> {
    if samples.len() != expected {
        return Err(DynamicsError::LengthMismatch { name, found: samples.len(), expected });
    }
    match samples.iter().position(|sample| !sample.is_finite()) {
        Some(sample) => Err(DynamicsError::NotFinite { name, sample }),
        None => Ok(()),
    }
}

/// C2 cubic spline with not-a-knot ends through samples at unit spacing; one cubic per interval.
fn spline(samples: &[f64]) -> Vec<Cubic> {
    let rise: Vec<f64> = samples.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let n = samples.len();
    // Unknowns are the slopes: s[i-1] + 4 s[i] + s[i+1] = 3 (y[i+1] - y[i-1]), and at the ends
    // s[0] + 2 s[1] = (5 rise[0] + rise[1]) / 2, which makes the first two cubics one.
    let mut upper = vec![2.0; n];
    let mut slope = vec![0.0; n];
    slope[0] = 0.5 * (5.0 * rise[0] + rise[1]);
    for i in 1..n - 1 {
        let pivot = 1.0 / (4.0 - upper[i - 1]);
        upper[i] = pivot;
        slope[i] = (3.0 * (rise[i - 1] + rise[i]) - slope[i - 1]) * pivot;
    }
    let end = 0.5 * (5.0 * rise[n - 2] + rise[n - 3]);
    slope[n - 1] = (end - 2.0 * slope[n - 2]) / (1.0 - 2.0 * upper[n - 2]);
    for i in (0..n - 1).rev() {
        slope[i] -= upper[i] * slope[i + 1];
    }
    (0..n - 1)
        .map(|i| {
            let (start, end) = (slope[i], slope[i + 1]);
            [samples[i], start, 3.0 * rise[i] - 2.0 * start - end, start + end - 2.0 * rise[i]]
        })
        .collect()
}
