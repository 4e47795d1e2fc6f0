//! Loading history of a damper: displacement and velocity on a uniform grid, with cubic splines.

use crate::damper::model::{Motion, Severity};
use crate::error::DynamicsError;

/// Fewest samples of a loading history, as the not-a-knot spline requires.
pub const MIN_SAMPLES: usize = 4;

/// Coefficients of a cubic in `u` from 0 to 1 over one sample interval, lowest power first.
type Cubic = [f64; 4];

/// Displacement and velocity between two samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval {
    displacement: Cubic,
    velocity: Cubic,
}

impl Interval {
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
pub struct LoadingHistory {
    dt: f64,
    intervals: Vec<Interval>,
    last: Motion<f64>,
    severity: Severity,
    command: Command,
    command_levels: Vec<f64>,
}

impl LoadingHistory {
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
        let intervals: Vec<Interval> = x
            .into_iter()
            .zip(v)
            .map(|(displacement, velocity)| Interval { displacement, velocity })
            .collect();
        let end = |interval: &Interval| interval.motion(1.0);
        let mut last = intervals.last().map_or(Motion { displacement: 0.0, velocity: 0.0 }, end);
        if let (Some(&x), Some(&v)) = (displacement.last(), velocity.and_then(<[f64]>::last)) {
            last = Motion { displacement: x, velocity: v };
        }
        let severity = severity(dt, &intervals);
        let (command, command_levels) = (Command::Held(f64::NAN), vec![f64::NAN]);
        Ok(Self { dt, intervals, last, severity, command, command_levels })
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

    /// The spline pieces, one per sample interval.
    pub(crate) fn intervals(&self) -> &[Interval] {
        &self.intervals
    }

    /// Motion at the last sample.
    pub(crate) fn last(&self) -> Motion<f64> {
        self.last
    }

    /// Motion at the stage times of `substeps` Runge-Kutta steps per interval: `2 substeps + 1` equally spaced motions per
    /// interval, both ends included.
    #[must_use]
    pub fn stages(&self, substeps: u32) -> Vec<Motion<f64>> {
        let halves = 2 * substeps;
        self.intervals
            .iter()
            .flat_map(|interval| {
                (0..=halves).map(|half| interval.motion(f64::from(half) / f64::from(halves)))
            })
            .collect()
    }
}

fn severity(dt: f64, intervals: &[Interval]) -> Severity {
    let mut severity = Severity { peak_velocity: 0.0, reversal_acceleration: 0.0 };
    for interval in intervals {
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
