//! Further signals of a law of measured signals: accelerations, and running root mean squares.

use super::measurement::Measurement;
use crate::elementary::exp;
use crate::lanes::Lanes;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Elongation of the device [m].
    Deformation,
    /// Its rate [m/s].
    Rate,
    /// Its force [N].
    Force,
    /// Absolute acceleration of its upper end less that of its lower end [m/s^2].
    Acceleration,
    /// Absolute acceleration of a floor [m/s^2].
    Floor(usize),
    /// Acceleration of the ground [m/s^2].
    GroundAcceleration,
}

impl Source {
    /// Whether it is the absolute acceleration of floors.
    pub(crate) const fn is_acceleration(self) -> bool {
        matches!(self, Self::Acceleration | Self::Floor(_))
    }
}

/// A further signal of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// What is measured.
    pub source: Source,
    /// Time constant [s] of its running root mean square; `None` for the reading itself.
    ///
    /// The mean of the squares is `s = a s + (1 - a) y^2`, `a = exp(-Ts / time_constant)`, from zero on.
    pub time_constant: Option<f64>,
}

/// The further signals of a law, and the mean squares that it keeps from sample to sample.
pub(crate) struct Further<'a, R> {
    signals: &'a [Signal],
    /// Share of each mean square that a sample leaves; zero for a reading itself.
    left: Vec<f64>,
    /// Mean square of each device and signal.
    squares: Vec<R>,
    values: Vec<R>,
}

impl<'a, R: Lanes> Further<'a, R> {
    pub(crate) fn new(signals: &'a [Signal], n_devices: usize, sample_time: f64) -> Self {
        let left =
            |signal: &Signal| signal.time_constant.map_or(0.0, |constant| exp(-sample_time / constant));
        Self {
            signals,
            left: signals.iter().map(left).collect(),
            squares: vec![R::splat(0.0); n_devices * signals.len()],
            values: vec![R::splat(0.0); signals.len()],
        }
    }

    /// Values of the signals for a device at a sample, each once.
    ///
    /// A reading that is not finite leaves the mean square, and is the value.
    #[inline(always)]
    pub(crate) fn read(&mut self, measured: &Measurement<'_, R>, device: usize) -> &mut [R] {
        let count = self.signals.len();
        let squares = &mut self.squares[device * count..][..count];
        for (index, signal) in self.signals.iter().enumerate() {
            let reading = match signal.source {
                Source::Deformation => measured.deformation[device],
                Source::Rate => measured.rate[device],
                Source::Force => measured.force[device],
                Source::Acceleration => measured.absolute_acceleration(device),
                Source::Floor(floor) => measured.acceleration[floor],
                Source::GroundAcceleration => measured.ground_acceleration,
            };
            self.values[index] = reading;
            if signal.time_constant.is_some() {
                let left = self.left[index];
                let finite = reading.abs().less(R::splat(f64::INFINITY));
                let fresh = reading * reading * R::splat(1.0 - left);
                squares[index] =
                    R::select(finite, squares[index].mul_add(R::splat(left), fresh), squares[index]);
                self.values[index] = R::select(finite, squares[index].sqrt(), reading);
            }
        }
        &mut self.values
    }

    /// The values that were read last, with their signals.
    #[inline(always)]
    pub(crate) fn values(&self) -> impl Iterator<Item = (&R, &'a Signal)> {
        self.values.iter().zip(self.signals)
    }
}
