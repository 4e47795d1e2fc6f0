//! A ground motion: acceleration and forces on floors, linear between samples.

use crate::error::DynamicsError;

/// Acceleration of the ground on a uniform grid, and forces on floors on the same; zero after their end.
#[derive(Clone, Debug)]
pub struct GroundMotion {
    dt: f64,
    acceleration: Vec<f64>,
    /// Velocity at the samples [m/s], exact for the linear interpolation.
    velocity: Vec<f64>,
    /// Forces on each floor at the samples [N]; empty for none.
    forces: Vec<Vec<f64>>,
    /// Whether the state that laws read has absolute velocities.
    is_absolute: bool,
}

/// Part of a step below which the interval of a record is finer than the step; intervals may be rounded.
const FINER: f64 = 0.999;

/// A time among the samples.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// Between a sample and the next.
    Between { index: usize, fraction: f64 },
    /// At the last sample or after it.
    After { is_last: bool },
}

impl GroundMotion {
    /// From samples [m/s^2] at the interval `dt` [s].
    ///
    /// # Errors
    /// If there are fewer than two samples, one is not finite, or the interval is not positive.
    pub fn new(dt: f64, acceleration: &[f64]) -> Result<Self, DynamicsError> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(DynamicsError::Step(dt));
        }
        if acceleration.len() < 2 {
            return Err(DynamicsError::ShortMotion(acceleration.len()));
        }
        if let Some(sample) = acceleration.iter().position(|value| !value.is_finite()) {
            return Err(DynamicsError::NotFinite { name: "acceleration", sample });
        }
        let mut velocity = Vec::with_capacity(acceleration.len());
        let mut sum = 0.0;
        velocity.push(sum);
        for pair in acceleration.windows(2) {
            sum += 0.5 * dt * (pair[0] + pair[1]);
            velocity.push(sum);
        }
        Ok(Self { dt, acceleration: acceleration.to_vec(), velocity, forces: Vec::new(), is_absolute: false })
    }

    /// The same motion with forces on floors [N]: a history for each floor, with a sample for each of the acceleration.
    ///
    /// # Errors
    /// If the samples are not as many as those of the acceleration, or one is not finite.
    pub fn with_forces(self, forces: Vec<Vec<f64>>) -> Result<Self, DynamicsError> {
        for samples in &forces {
            let (found, expected) = (samples.len(), self.acceleration.len());
            if found != expected {
                return Err(DynamicsError::MatrixSize { name: "forces", found, expected });
            }
            if let Some(sample) = samples.iter().position(|value| !value.is_finite()) {
                return Err(DynamicsError::NotFinite { name: "forces", sample });
            }
        }
        Ok(Self { forces, ..self })
    }

    /// The same motion, under which laws read a state of relative displacements and absolute velocities `q' + r v_g`, as on
    /// a road, whose velocity and not its acceleration is near white.
    #[must_use]
    pub fn with_absolute_state(self, is_absolute: bool) -> Self {
        Self { is_absolute, ..self }
    }

    /// Whether the state that laws read has absolute velocities.
    pub(crate) fn is_absolute(&self) -> bool {
        self.is_absolute
    }

    /// Number of floors on which there are forces.
    pub(crate) fn n_forced(&self) -> usize {
        self.forces.len()
    }

    /// Force on a floor at a place of [`GroundMotion::place`] [N].
    #[inline(always)]
    pub(crate) fn force(&self, floor: usize, place: Place) -> f64 {
        at(&self.forces[floor], place)
    }

    /// Time from the first sample to the last [s].
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.dt * to_f64(self.acceleration.len() - 1)
    }

    /// Acceleration at a time [m/s^2]; zero after the end.
    #[must_use]
    #[inline(always)]
    pub fn acceleration(&self, time: f64) -> f64 {
        at(&self.acceleration, self.place(time))
    }

    /// Velocity at a time [m/s]; the last after the end.
    #[must_use]
    #[inline]
    pub fn velocity(&self, time: f64) -> f64 {
        match self.place(time) {
            Place::After { .. } => self.velocity[self.velocity.len() - 1],
            Place::Between { index, fraction } => {
                let mean = self.acceleration[index] + between(&self.acceleration, index, fraction);
                (0.5 * fraction * self.dt).mul_add(mean, self.velocity[index])
            }
        }
    }

    /// Acceleration that a sensor reads at a time [m/s^2]: of a record finer than the step [s] the mean over the step before.
    pub(crate) fn reading(&self, time: f64, step: f64) -> f64 {
        if self.dt < FINER * step {
            // Before the record the ground is still.
            return (self.velocity(time) - self.velocity((time - step).max(0.0))) / step;
        }
        self.acceleration(time)
    }

    /// Accelerations at start, middle and end of each of the first `count` steps of a record finer than the step [s], else
    /// none: such a record has several samples in a step, which points in its middle and at its ends would miss.
    ///
    /// A step of classical Runge-Kutta takes the state of a linear plant, `x' = A x + B a(t)`, from 0 to
    /// `h/6 ((a0 + 4 am + a1) + hA (a0 + 2 am) + (hA)^2 (a0 + am) / 2 + (hA)^3 a0 / 4) B`. The exact state is
    /// `h (M0 + hA M1 + (hA)^2 M2 / 2 + ...) B`, where the moment `Mk` is the mean of `(1 - s)^k a` over the step and s runs
    /// from 0 to 1 in it. The line `M0 - b/2, M0, M0 + b/2` with `b = 6 M0 - 12 M1` has the moments M0 and M1 of the
    /// record: the error of a step is of third order in `hA` whatever the record does within it. Where the record is smooth
    /// over a step, it differs from the line by terms of second order, and M2 too: the error at a time is of fourth order.
    #[must_use]
    pub fn stages(&self, step: f64, count: usize) -> Option<Vec<[f64; 3]>> {
        let lines = || (0..count).map(|number| line(&self.acceleration, number, step / self.dt)).collect();
        (self.dt < FINER * step).then(lines)
    }

    /// Forces at start, middle and end of each of the first `count` steps, as [`GroundMotion::stages`]: of every step those
    /// of all floors.
    pub(crate) fn force_stages(&self, step: f64, count: usize) -> Option<Vec<[f64; 3]>> {
        let length = step / self.dt;
        let lines = |number| self.forces.iter().map(move |samples| line(samples, number, length));
        (self.dt < FINER * step).then(|| (0..count).flat_map(lines).collect())
    }

    /// Where a time is among the samples.
    #[inline(always)]
    pub(crate) fn place(&self, time: f64) -> Place {
        let position = time / self.dt;
        let last = self.acceleration.len() - 1;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // times are not negative
        let index = position as usize;
        if index >= last {
            // A time equal to that of the last sample except for rounding has its value.
            let on_it = position <= to_f64(last) * (1.0 + 1e-12);
            return Place::After { is_last: on_it };
        }
        Place::Between { index, fraction: position - to_f64(index) }
    }
}

/// A history at a place; zero after its end.
#[inline(always)]
fn at(samples: &[f64], place: Place) -> f64 {
    match place {
        Place::After { is_last: true } => samples[samples.len() - 1],
        Place::After { is_last: false } => 0.0,
        Place::Between { index, fraction } => between(samples, index, fraction),
    }
}

#[inline(always)]
fn between(samples: &[f64], index: usize, fraction: f64) -> f64 {
    let (start, end) = (samples[index], samples[index + 1]);
    fraction.mul_add(end - start, start)
}

/// The line with the moments of a history over a step; its length is in samples.
fn line(samples: &[f64], number: usize, length: f64) -> [f64; 3] {
    let (start, end) = (to_f64(number) * length, to_f64(number + 1) * length);
    let (mut mean, mut moment) = (0.0, 0.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // times are not negative
    for index in (start as usize)..samples.len() - 1 {
        let before = to_f64(index);
        if before >= end {
            break;
        }
        let (from, to) = (start.max(before), end.min(before + 1.0));
        let (first, last) = (between(samples, index, from - before), between(samples, index, to - before));
        let share = (to - from) / length;
        let (left_first, left_last) = ((end - from) / length, (end - to) / length);
        mean += 0.5 * share * (first + last);
        moment +=
            share / 6.0 * (first * (2.0 * left_first + left_last) + last * (left_first + 2.0 * left_last));
    }
    let half = 3.0 * mean - 6.0 * moment;
    [mean - half, mean, mean + half]
}

#[allow(clippy::cast_precision_loss)] // counts of samples are far below 2^53
fn to_f64(count: usize) -> f64 {
    count as f64
}
