//! The devices of a block of lanes: their states, and their parameters as the coil follows the command.

use super::batch::Batch;
use crate::current_law::CurrentLaws;
use crate::damper::{DamperModel, Motion, State};
use crate::elementary::exp;
use crate::lanes::{Apart, Lanes};
use crate::parameters::{FromSlice, Scale};
use crate::real::Real;

/// Moments of a step at which parameters are known.
pub(super) const MIDDLE: usize = 0;
pub(super) const END: usize = 1;

/// All devices, each one damper or two in opposition.
pub(super) struct Dampers<'a, M: DamperModel, R: Real> {
    laws: &'a CurrentLaws,
    follows: bool,
    lagged: bool,
    devices: Vec<Device<M, R>>,
    /// Force with which each device resists [N].
    pub(super) force: Vec<R>,
    /// What each coil has got of its command.
    pub(super) current: Vec<R>,
    values: Vec<R>,
}

struct Device<M: DamperModel, R: Real> {
    columns: Vec<R>,
    held: R,
    /// What is left of the difference after half a step; zero without a lag.
    decay: R,
    /// Whether two in opposition are counted as one with twice the force, which has no offset.
    merged: bool,
    /// Parameters in the middle and at the end of a step; those at its start are what the end before was.
    at: [M::Parameters<R>; 2],
    dampers: Vec<Hidden<M, R>>,
}

/// States of the dampers on one side of a device, through the stages of a step.
struct Hidden<M: DamperModel, R: Real> {
    /// 1, or -1 for those that are shortened where the others are elongated.
    side: f64,
    /// How many they are, with the sign of their side.
    share: f64,
    now: M::State<R>,
    staged: M::State<R>,
    rate: M::State<R>,
    next: M::State<R>,
}

impl<M: DamperModel, R: Real> Hidden<M, R> {
    fn at_rest(side: f64, count: f64) -> Self {
        let rest = M::State::from_fn(|_| R::splat(0.0));
        Self { side, share: side * count, now: rest, staged: rest, rate: rest, next: rest }
    }
}

impl<'a, M: DamperModel, R: Lanes> Dampers<'a, M, R> {
    /// At rest, without a command yet, for these runs.
    pub(super) fn new(batch: &Batch<'a>, runs: &[usize], step: f64) -> Self {
        let Batch { laws, places, theta, .. } = *batch;
        let n_columns = laws.n_columns();
        let last = runs.len() - 1;
        let mut devices = Vec::with_capacity(places.len());
        let values = vec![R::splat(f64::NAN); laws.n_params()];
        let at = [M::Parameters::from_slice(&values); 2];
        for (index, &place) in places.iter().enumerate() {
            let mut columns = Vec::with_capacity(n_columns);
            for column in 0..n_columns {
                columns.push(R::from_fn(|lane| {
                    let draw = batch.runs[runs[lane.min(last)]].draw as usize;
                    theta[(draw * places.len() + index) * n_columns + column]
                }));
            }
            let merged = place.differential && M::SPEC.odd && M::SPEC.offset_adds;
            let dampers = match (merged, place.differential) {
                (true, _) => vec![Hidden::at_rest(1.0, 2.0 * place.count)],
                (false, true) => [1.0, -1.0].map(|side| Hidden::at_rest(side, place.count)).into(),
                (false, false) => vec![Hidden::at_rest(1.0, place.count)],
            };
            devices.push(Device { columns, held: R::splat(0.0), decay: R::splat(0.0), merged, at, dampers });
        }
        let mut dampers = Self {
            laws,
            follows: !laws.are_constant(),
            lagged: laws.lag_column().is_some(),
            force: vec![R::splat(0.0); devices.len()],
            current: vec![R::splat(0.0); devices.len()],
            devices,
            values,
        };
        R::apart(Prepare { dampers: &mut dampers, step });
        dampers
    }

    /// Hands every coil its command; whether the forces change by that at once.
    pub(super) fn hold(&mut self, commands: &[R], at_once: bool) -> bool {
        let jumps = at_once || !self.lagged;
        R::apart(Hold { dampers: self, commands, jumps });
        jumps
    }

    /// Works out the parameters of the middle and end of a step; those of the start are what the end was.
    pub(super) fn follow(&mut self) {
        if self.follows {
            R::apart(Follow { dampers: self });
        }
    }

    /// Forces, and rates of the states, where each device is elongated so far and so fast; parameters of that moment.
    pub(super) fn resist(&mut self, elongation: &[R], rate: &[R], moment: usize) {
        R::apart(Resist { dampers: self, elongation, rate, moment });
    }

    /// Adds the rates of a stage to the step, and goes to the next stage; a step ends with the stage that reaches nowhere.
    pub(super) fn stage(&mut self, weight: f64, reach: f64) {
        if M::SPEC.n_states > 0 {
            R::apart(Advance { dampers: self, weight, reach });
        }
    }

    /// Parameters of a device at its current, as those of the start, middle or end of a step.
    #[inline(always)]
    fn evaluate(&mut self, device: usize, moment: usize) {
        let own = &mut self.devices[device];
        self.laws.evaluate(&own.columns, self.current[device], &mut self.values);
        if own.merged {
            for (value, parameter) in self.values.iter_mut().zip(M::SPEC.parameters) {
                if parameter.scale == Scale::Offset {
                    *value = R::splat(0.0);
                }
            }
        }
        own.at[moment] = M::Parameters::from_slice(&self.values);
    }
}

/// Before the first step: what the lag leaves in half a step, and the parameters without a command.
struct Prepare<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
    step: f64,
}

impl<M: DamperModel, R: Lanes> Apart for Prepare<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        for index in 0..self.dampers.devices.len() {
            let device = &mut self.dampers.devices[index];
            if let Some(column) = self.dampers.laws.lag_column() {
                device.decay = exp(device.columns[column] * R::splat(-0.5 * self.step));
            }
            for moment in [MIDDLE, END] {
                self.dampers.evaluate(index, moment);
            }
        }
    }
}

struct Hold<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
    commands: &'a [R],
    jumps: bool,
}

impl<M: DamperModel, R: Lanes> Apart for Hold<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { dampers, commands, jumps } = self;
        for (device, &command) in commands.iter().enumerate() {
            dampers.devices[device].held = command;
            if jumps {
                dampers.current[device] = command;
                if dampers.follows {
                    dampers.evaluate(device, END);
                }
            }
        }
    }
}

struct Follow<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
}

impl<M: DamperModel, R: Lanes> Apart for Follow<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { dampers } = self;
        for index in 0..dampers.devices.len() {
            let device = &mut dampers.devices[index];
            let (held, decay) = (device.held, device.decay);
            if dampers.lagged {
                for moment in [MIDDLE, END] {
                    dampers.current[index] = (dampers.current[index] - held).mul_add(decay, held);
                    dampers.evaluate(index, moment);
                }
            } else {
                device.at[MIDDLE] = device.at[END];
            }
        }
    }
}

struct Resist<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
    elongation: &'a [R],
    rate: &'a [R],
    moment: usize,
}

impl<M: DamperModel, R: Lanes> Apart for Resist<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { dampers, elongation, rate, moment } = self;
        for (index, device) in dampers.devices.iter_mut().enumerate() {
            let p = &device.at[moment];
            let mut sum = R::splat(0.0);
            for hidden in &mut device.dampers {
                let side = R::splat(hidden.side);
                let motion = Motion { displacement: elongation[index] * side, velocity: rate[index] * side };
                sum = M::force(p, hidden.staged, motion).mul_add(R::splat(hidden.share), sum);
                if M::SPEC.n_states > 0 {
                    hidden.rate = M::rate(p, hidden.staged, motion);
                }
            }
            dampers.force[index] = sum;
        }
    }
}

struct Advance<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
    weight: f64,
    reach: f64,
}

impl<M: DamperModel, R: Lanes> Apart for Advance<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let (weight, reach) = (R::splat(self.weight), R::splat(self.reach));
        let ends = self.reach == 0.0;
        for device in &mut self.dampers.devices {
            for hidden in &mut device.dampers {
                hidden.next = hidden.next.advance(weight, hidden.rate);
                if ends {
                    hidden.now = hidden.next;
                }
                hidden.staged = hidden.now.advance(reach, hidden.rate);
            }
        }
    }
}
