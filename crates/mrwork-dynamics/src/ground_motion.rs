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
