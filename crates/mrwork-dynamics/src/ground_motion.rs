//! A ground motion: acceleration, linear between samples.

use crate::error::DynamicsError;

/// Acceleration of the ground on a uniform grid; zero after its end.
#[derive(Clone, Debug)]
pub struct GroundMotion {
    dt: f64,
    acceleration: Vec<f64>,
    /// Velocity at the samples [m/s], exact for the linear interpolation.
    velocity: Vec<f64>,
}

/// Part of a step below which the interval of a record is finer than the step; intervals may be rounded.
const FINER: f64 = 0.999;

/// A time among the samples.
enum Place {
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
        Ok(Self { dt, acceleration: acceleration.to_vec(), velocity })
    }

    /// Time from the first sample to the last [s].
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.dt * to_f64(self.acceleration.len() - 1)
    }

    /// Acceleration at a time [m/s^2]; zero after the end.
    #[must_use]
    #[inline]
    pub fn acceleration(&self, time: f64) -> f64 {
        match self.place(time) {
            Place::After { is_last: true } => self.acceleration[self.acceleration.len() - 1],
            Place::After { is_last: false } => 0.0,
            Place::Between { index, fraction } => self.between(index, fraction),
        }
    }

    /// Velocity at a time [m/s]; the last after the end.
    #[must_use]
    #[inline]
    pub fn velocity(&self, time: f64) -> f64 {
        match self.place(time) {
            Place::After { .. } => self.velocity[self.velocity.len() - 1],
            Place::Between { index, fraction } => {
                let mean = self.acceleration[index] + self.between(index, fraction);
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
        (self.dt < FINER * step).then(|| (0..count).map(|number| self.line(number, step / self.dt)).collect())
    }

    /// The line with the moments of the record over a step; its length is in samples.
    fn line(&self, number: usize, length: f64) -> [f64; 3] {
        let (start, end) = (to_f64(number) * length, to_f64(number + 1) * length);
        let (mut mean, mut moment) = (0.0, 0.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // times are not negative
        for index in (start as usize)..self.acceleration.len() - 1 {
            let before = to_f64(index);
            if before >= end {
                break;
            }
            let (from, to) = (start.max(before), end.min(before + 1.0));
            let (first, last) = (self.between(index, from - before), self.between(index, to - before));
            let share = (to - from) / length;
            let (left_first, left_last) = ((end - from) / length, (end - to) / length);
            mean += 0.5 * share * (first + last);
            moment += share / 6.0
                * (first * (2.0 * left_first + left_last) + last * (left_first + 2.0 * left_last));
        }
        let half = 3.0 * mean - 6.0 * moment;
        [mean - half, mean, mean + half]
    }

    #[inline]
    fn between(&self, index: usize, fraction: f64) -> f64 {
        let (start, end) = (self.acceleration[index], self.acceleration[index + 1]);
        fraction.mul_add(end - start, start)
    }

    #[inline]
    fn place(&self, time: f64) -> Place {
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

#[allow(clippy::cast_precision_loss)] // counts of samples are far below 2^53
fn to_f64(count: usize) -> f64 {
    count as f64
}
