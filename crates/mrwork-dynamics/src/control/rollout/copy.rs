//! What the controller knows of its dampers between two samples: coil currents and damper states, which no sensor
//! measures, from the commands that were sent and the measured motion; and how the measured force differs.

use super::Timing;
use super::prediction::Prediction;
use crate::control::{Measurement, within};
use crate::damper::model::{DamperModel, Motion, State};
use crate::lanes::Lanes;
use crate::real::Real;

/// Smallest and largest factor on the force of the model.
const FACTORS: [f64; 2] = [0.7, 1.3];

/// A stretch of time with one command, in steps of the model.
pub(super) struct Stretch<R> {
    pub(super) length: f64,
    pub(super) steps: u32,
    /// Share of the difference of current and command that is left after half a step, of each device.
    pub(super) decay: Vec<R>,
}

impl<R: Lanes> Stretch<R> {
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // few steps
    pub(super) fn new<M: DamperModel>(prediction: &Prediction<'_, M, R>, length: f64, longest: f64) -> Self {
        let steps = (length / longest * (1.0 - 1e-9)).ceil().max(1.0);
        let decay = (0..prediction.n_devices())
            .map(|device| prediction.decay(device, 0.5 * length / steps))
            .collect();
        Self { length, steps: steps as u32, decay }
    }

    /// Length of a step.
    pub(super) fn step(&self) -> f64 {
        self.length / f64::from(self.steps)
    }
}

/// A copy of the dampers' inner states in the controller.
pub(super) struct DamperCopy<M: DamperModel, R: Lanes> {
    pub(super) current: Vec<R>,
    pub(super) states: Vec<M::State<R>>,
    staged: Vec<M::State<R>>,
    next: Vec<M::State<R>>,
    /// Last readings that were numbers.
    deformation: Vec<R>,
    rate: Vec<R>,
    /// Commands of the last samples, a ring buffer.
    sent: Vec<R>,
    depth: usize,
    /// From a sample until a command arrives, and from there to the next sample.
    before: Option<Stretch<R>>,
    after: Stretch<R>,
    /// Mean squares of the measured force and of that of the model, with the weight of a sample, and what counts [N^2].
    measured: Vec<R>,
    expected: Vec<R>,
    weight: f64,
    counted: f64,
}

impl<M: DamperModel, R: Lanes> DamperCopy<M, R> {
    /// At rest, with the coils at these currents.
    #[inline(always)]
    pub(super) fn new(
        prediction: &Prediction<'_, M, R>,
        timing: &Timing,
        current: &[R],
        [time, force]: [f64; 2],
    ) -> Self {
        let n_devices = prediction.n_devices();
        let zero = vec![R::splat(0.0); n_devices];
        let rest = vec![M::State::from_fn(|_| R::splat(0.0)); prediction.n_sides];
        let Timing { sample_time, delay_rest, .. } = *timing;
        let depth = timing.delay_samples + 2;
        Self {
            current: current.to_vec(),
            staged: rest.clone(),
            next: rest.clone(),
            states: rest,
            deformation: zero.clone(),
            rate: zero.clone(),
            sent: vec![R::splat(0.0); depth * n_devices],
            depth,
            before: (delay_rest > 0.0).then(|| Stretch::new(prediction, delay_rest, timing.step())),
            after: Stretch::new(prediction, sample_time - delay_rest, timing.step()),
            measured: zero.clone(),
            expected: zero,
            weight: (sample_time / time).min(1.0),
            counted: force * force,
        }
    }

    /// Commands of a sample, the first one for those before it.
    #[inline(always)]
    pub(super) fn sent_at(&self, sample: usize, earlier: usize) -> &[R] {
        let n_devices = self.current.len();
        &self.sent[(sample.saturating_sub(earlier) % self.depth) * n_devices..][..n_devices]
    }

    /// Takes the commands of the sample before `number`, and moves on to the present one.
    #[inline(always)]
    pub(super) fn advance(
        &mut self,
        prediction: &mut Prediction<'_, M, R>,
        timing: &Timing,
        number: usize,
        measured: &Measurement<'_, R>,
    ) {
        let n_devices = self.current.len();
        if let Some(last) = number.checked_sub(1) {
            let place = (last % self.depth) * n_devices;
            self.sent[place..place + n_devices].copy_from_slice(measured.sent);
            if last == 0 {
                // The coils have settled at the first command when the motion begins.
                self.current.copy_from_slice(measured.sent);
            }
            for device in 0..n_devices {
                let to = [
                    known_or(measured.deformation[device], self.deformation[device]),
                    known_or(measured.rate[device], self.rate[device]),
                ];
                let late = usize::from(self.before.is_some());
                let earlier = self.sent_at(last, timing.delay_samples + late)[device];
                let now = self.sent_at(last, timing.delay_samples)[device];
                self.cross(prediction, device, [true, false], earlier, to);
                self.cross(prediction, device, [false, true], now, to);
            }
        }
        for device in 0..n_devices {
            self.deformation[device] = known_or(measured.deformation[device], self.deformation[device]);
            self.rate[device] = known_or(measured.rate[device], self.rate[device]);
        }
    }

    /// Integrates one of the two stretches between the samples for a device, under a motion straight between them.
    #[inline(always)]
    fn cross(
        &mut self,
        prediction: &mut Prediction<'_, M, R>,
        device: usize,
        [first, _]: [bool; 2],
        command: R,
        [x_to, v_to]: [R; 2],
    ) {
        let (stretch, offset) = match (&self.before, first) {
            (Some(before), true) => (before, 0.0),
            (None, true) => return,
            (Some(before), false) => (&self.after, before.length),
            (None, false) => (&self.after, 0.0),
        };
        let whole = self.before.as_ref().map_or(0.0, |before| before.length) + self.after.length;
        let (step, decay) = (stretch.step(), stretch.decay[device]);
        let (x_from, v_from) = (self.deformation[device], self.rate[device]);
        if !prediction.lagged {
            self.current[device] = command;
        }
        for number in 0..stretch.steps {
            if M::SPEC.n_states > 0 {
                prediction.set_current(device, self.current[device]);
            }
            let weights = [step / 6.0, step / 3.0, step / 3.0, step / 6.0];
            let reaches = [0.5 * step, 0.5 * step, step, 0.0];
            let places = [0.0, 0.5, 0.5, 1.0];
            self.staged.copy_from_slice(&self.states);
            self.next.copy_from_slice(&self.states);
            for stage in 0..weights.len() {
                if stage == 1 || stage == 3 {
                    self.current[device] = (self.current[device] - command).mul_add(decay, command);
                    if M::SPEC.n_states > 0 {
                        prediction.set_current(device, self.current[device]);
                    }
                }
                if M::SPEC.n_states > 0 {
                    let share = R::splat((offset + step * (f64::from(number) + places[stage])) / whole);
                    let motion = Motion {
                        displacement: (x_to - x_from).mul_add(share, x_from),
                        velocity: (v_to - v_from).mul_add(share, v_from),
                    };
                    prediction.force_of(device, &self.staged, motion);
                    prediction.move_states(device, weights[stage], None, &mut self.next);
                    prediction.move_states(device, reaches[stage], Some(&self.states), &mut self.staged);
                }
            }
            self.states.copy_from_slice(&self.next);
        }
    }

    /// Compares the measured forces with those of the model, and sets the factors of the model to this share of the
    /// error: `s = 1 + share (rms f / rms f_m - 1)`, mean squares that fade, with that of a force that counts in both.
    ///
    /// The ratio of their products would be biased by the noise of the estimated motion.
    #[inline(always)]
    pub(super) fn compare(
        &mut self,
        prediction: &mut Prediction<'_, M, R>,
        measured: &Measurement<'_, R>,
        share: R,
        factors: bool,
    ) {
        let (weight, counted) = (R::splat(self.weight), R::splat(self.counted));
        prediction.set_currents(&self.current);
        for device in 0..self.current.len() {
            let motion = Motion { displacement: self.deformation[device], velocity: self.rate[device] };
            let own = prediction.force_of(device, &self.states, motion);
            let force = measured.force[device];
            let [found, expected] = [self.measured[device], self.expected[device]];
            let next = [force.mul_add(force, -found), own.mul_add(own, -expected)];
            let known = (force.abs() + own.abs()).less(R::splat(f64::INFINITY));
            self.measured[device] = R::select(known, next[0].mul_add(weight, found), found);
            self.expected[device] = R::select(known, next[1].mul_add(weight, expected), expected);
            if factors {
                let ratio = (self.measured[device] + counted) / (self.expected[device] + counted);
                let factor = share.mul_add(ratio.sqrt() - R::splat(1.0), R::splat(1.0));
                prediction.scale[device] = within(factor, R::splat(FACTORS[0]), R::splat(FACTORS[1]));
            }
        }
    }
}

/// `value`, or `otherwise` where it is not a number.
#[inline(always)]
fn known_or<R: Real>(value: R, otherwise: R) -> R {
    R::select(value.equal(value), value, otherwise)
}
