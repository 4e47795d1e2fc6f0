//! What the controller knows of its dampers between two samples: coil currents and damper states, which no sensor
//! measures, from the commands that were sent and the measured motion; and how the measured force differs.

use super::timing::Timing;
use crate::control::measurement::Measurement;
use crate::coupled::{DeviceState, Devices, END, stages};
use crate::lanes::Lanes;
use crate::real::{Real, within};

/// Smallest and largest factor on the force of the model.
const FACTORS: [f64; 2] = [0.7, 1.3];
/// Smallest weight of accelerations [s4/m2] from which the force that counts is worked out.
const SMALLEST_WEIGHT: f64 = 1e-12;

/// A stretch of time with one command, in steps of the model.
#[derive(Clone, Copy)]
pub(super) struct Stretch {
    pub(super) length: f64,
    pub(super) steps: u32,
}

impl Stretch {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // few steps
    pub(super) fn new(length: f64, longest: f64) -> Self {
        Self { length, steps: (length / longest * (1.0 - 1e-9)).ceil().max(1.0) as u32 }
    }

    /// Length of a step [s].
    pub(super) fn step(&self) -> f64 {
        self.length / f64::from(self.steps)
    }
}

/// A copy of the dampers in the controller.
pub(super) struct DamperCopy<'a, R: Lanes> {
    pub(super) devices: Box<dyn Devices<R> + 'a>,
    /// Last readings that were numbers, and those before.
    pub(super) deformation: Vec<R>,
    pub(super) rate: Vec<R>,
    pub(super) deformation_before: Vec<R>,
    pub(super) rate_before: Vec<R>,
    /// Motion at a stage.
    elongation: Vec<R>,
    elongation_rate: Vec<R>,
    /// Commands of the last samples, a ring buffer.
    sent: Vec<R>,
    depth: usize,
    /// From a sample until a command arrives, and from there to the next sample.
    pub(super) before: Option<Stretch>,
    pub(super) after: Stretch,
    /// Mean squares of the measured force and of that of the model, with the weight of a sample, and what counts [N^2].
    pub(super) measured: Vec<R>,
    pub(super) expected: Vec<R>,
    weight: f64,
    pub(super) counted: R,
}

impl<'a, R: Lanes> DamperCopy<'a, R> {
    /// At rest, with the coils at these currents.
    #[inline(always)]
    pub(super) fn new(
        mut devices: Box<dyn Devices<R> + 'a>,
        timing: &Timing,
        current: &[R],
        [time, mass]: [f64; 2],
        acceleration_weight: R,
    ) -> Self {
        let zero = vec![R::splat(0.0); current.len()];
        let Timing { sample_time, delay_rest, .. } = *timing;
        let depth = timing.delay_samples + 2;
        devices.receive(current, true);
        Self {
            devices,
            deformation: zero.clone(),
            rate: zero.clone(),
            deformation_before: zero.clone(),
            rate_before: zero.clone(),
            elongation: zero.clone(),
            elongation_rate: zero.clone(),
            sent: vec![R::splat(0.0); depth * current.len()],
            depth,
            before: (delay_rest > 0.0).then(|| Stretch::new(delay_rest, timing.step())),
            after: Stretch::new(sample_time - delay_rest, timing.step()),
            measured: zero.clone(),
            expected: zero,
            weight: (sample_time / time).min(1.0),
            counted: force_that_counts(mass, acceleration_weight),
        }
    }

    /// Commands of a sample, the first one for those before it.
    #[inline(always)]
    pub(super) fn sent_at(&self, sample: usize, earlier: usize) -> &[R] {
        let n_devices = self.deformation.len();
        &self.sent[(sample.saturating_sub(earlier) % self.depth) * n_devices..][..n_devices]
    }

    /// Writes currents and states of the dampers.
    pub(super) fn save(&self, into: &mut DeviceState<R>) {
        self.devices.save(into);
    }

    /// Takes the readings of a sample.
    #[inline(always)]
    pub(super) fn read(&mut self, measured: &Measurement<'_, R>) {
        self.deformation_before.copy_from_slice(&self.deformation);
        self.rate_before.copy_from_slice(&self.rate);
        for device in 0..self.deformation.len() {
            self.deformation[device] = known_or(measured.deformation[device], self.deformation[device]);
            self.rate[device] = known_or(measured.rate[device], self.rate[device]);
        }
    }

    /// Takes the commands of the sample before `number`, and moves on to the present one, whose readings it has.
    #[inline(always)]
    pub(super) fn advance(&mut self, timing: &Timing, number: usize, sent: &[R]) {
        let n_devices = self.deformation.len();
        let Some(last) = number.checked_sub(1) else { return };
        let place = (last % self.depth) * n_devices;
        self.sent[place..place + n_devices].copy_from_slice(sent);
        if last == 0 {
            // The coils have settled at the first command when the motion begins.
            self.devices.receive(sent, true);
        }
        let mut passed = 0.0;
        if let Some(before) = self.before {
            self.cross(before, passed, (last, timing.delay_samples + 1));
            passed = before.length;
        }
        self.cross(self.after, passed, (last, timing.delay_samples));
    }

    /// Integrates a stretch between two samples, under a motion straight between them and the command of a sample so many
    /// before another.
    #[inline(always)]
    fn cross(&mut self, stretch: Stretch, passed: f64, (last, earlier): (usize, usize)) {
        let n_devices = self.deformation.len();
        let place = (last.saturating_sub(earlier) % self.depth) * n_devices;
        let whole = self.before.map_or(0.0, |before| before.length) + self.after.length;
        let step = stretch.step();
        self.devices.set_step(step);
        self.devices.receive(&self.sent[place..place + n_devices], false);
        for number in 0..stretch.steps {
            let start = passed + step * f64::from(number);
            self.step(step, [0.0, 0.5 * step, step].map(|reach| R::splat((start + reach) / whole)));
        }
    }

    /// A step, at whose start, middle and end these are the shares of the way.
    #[inline(always)]
    pub(super) fn step(&mut self, step: f64, [start, middle, end]: [R; 3]) {
        self.evaluate(start, END);
        self.devices.advance_drivers();
        for stage in stages(step) {
            self.devices.advance(stage.weight, stage.reach);
            self.evaluate(if stage.moment == END { end } else { middle }, stage.moment);
        }
        self.devices.advance(step / 6.0, 0.0);
    }

    /// Evaluates the dampers at a share of the way from the readings before to the last.
    #[inline(always)]
    fn evaluate(&mut self, share: R, moment: usize) {
        for device in 0..self.elongation.len() {
            let (x, v) = (self.deformation_before[device], self.rate_before[device]);
            self.elongation[device] = (self.deformation[device] - x).mul_add(share, x);
            self.elongation_rate[device] = (self.rate[device] - v).mul_add(share, v);
        }
        self.devices.evaluate(&self.elongation, &self.elongation_rate, moment);
    }

    /// Compares the measured forces with those of the model; writes the factors of the model by this share of the error,
    /// if asked: `s = 1 + share (rms f / rms f_m - 1)`, mean squares that fade, with that of a force that counts in both.
    ///
    /// The ratio of their products would be biased by the noise of the estimated motion.
    #[inline(always)]
    pub(super) fn compare(&mut self, measured: &Measurement<'_, R>, share: R, factors: Option<&mut [R]>) {
        let (weight, counted) = (R::splat(self.weight), self.counted);
        self.devices.evaluate(&self.deformation, &self.rate, END);
        for (device, &own) in self.devices.force().iter().enumerate() {
            let force = measured.force[device];
            let [found, expected] = [self.measured[device], self.expected[device]];
            let next = [force.mul_add(force, -found), own.mul_add(own, -expected)];
            let known = (force.abs() + own.abs()).less(R::splat(f64::INFINITY));
            self.measured[device] = R::select(known, next[0].mul_add(weight, found), found);
            self.expected[device] = R::select(known, next[1].mul_add(weight, expected), expected);
        }
        for (device, factor) in factors.into_iter().flatten().enumerate() {
            let ratio = (self.measured[device] + counted) / (self.expected[device] + counted);
            let free = share.mul_add(ratio.sqrt() - R::splat(1.0), R::splat(1.0));
            *factor = within(free, R::splat(FACTORS[0]), R::splat(FACTORS[1]));
        }
    }
}

/// Square of the inertia force of a mass at the reference acceleration [N^2].
#[inline(always)]
pub(super) fn force_that_counts<R: Real>(mass: f64, acceleration_weight: R) -> R {
    R::splat(mass * mass) / within(acceleration_weight, R::splat(SMALLEST_WEIGHT), R::splat(f64::MAX))
}

/// `value`, or `otherwise` where it is not a number.
#[inline(always)]
fn known_or<R: Real>(value: R, otherwise: R) -> R {
    R::select(value.equal(value), value, otherwise)
}
