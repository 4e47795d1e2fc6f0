//! The devices of a block of lanes: damper states, and damper parameters as functions of the coil current.

use core::hint::black_box;

use super::batch::Batch;
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Motion, State};
use crate::elementary::exp;
use crate::lanes::{Lanes, OutOfLine};
use crate::parameters::{FromSlice, offsets};
use crate::real::Real;

/// Times within a step at which parameters are stored.
pub(super) const MIDDLE: usize = 0;
pub(super) const END: usize = 1;

/// All devices, each of one damper or of two in opposition.
pub(super) struct Dampers<'a, M: DamperModel, R: Real> {
    laws: &'a CurrentLaws,
    follows: bool,
    lagged: bool,
    devices: Vec<Device<M, R>>,
    /// Force with which each device resists [N].
    pub(super) force: Vec<R>,
    /// Current in each coil: the command behind the lag of the driver.
    pub(super) current: Vec<R>,
}

struct Device<M: DamperModel, R: Real> {
    /// Prepared before the first step.
    columns: Vec<R>,
    /// Parameters at the present current.
    values: Vec<R>,
    /// Command that the driver receives.
    command: R,
    /// Factor by which the lag reduces the difference of current and command in half a step; zero without a lag.
    decay: R,
    /// Parameters that count as zero: two dampers in opposition are computed as one with twice the force and no offset.
    cancelled: Vec<usize>,
    /// Parameters in the middle and at the end of a step; the start is the end of the step before.
    at: [M::Parameters<R>; 2],
    dampers: Vec<DamperStates<M, R>>,
}

/// States of the dampers on one side of a device, during the stages of a step.
struct DamperStates<M: DamperModel, R: Real> {
    /// 1, or -1 for dampers that shorten when the others lengthen.
    side: f64,
    /// Number of dampers, with the sign of `side`.
    share: f64,
    now: M::State<R>,
    staged: M::State<R>,
    rate: M::State<R>,
    next: M::State<R>,
}

impl<M: DamperModel, R: Real> DamperStates<M, R> {
    fn at_rest(side: f64, count: f64) -> Self {
        let rest = M::State::from_fn(|_| R::splat(0.0));
        Self { side, share: side * count, now: rest, staged: rest, rate: rest, next: rest }
    }
}

impl<'a, M: DamperModel, R: Lanes> Dampers<'a, M, R> {
    /// Dampers at rest, before the first command.
    pub(super) fn new(batch: &Batch<'a>, runs: &[usize], step: f64) -> Self {
        let Batch { laws, mountings, theta, .. } = *batch;
        let n_columns = laws.n_columns();
        let last = runs.len() - 1;
        let mut devices = Vec::with_capacity(mountings.len());
        let values = vec![R::splat(f64::NAN); laws.n_params()];
        let at = [M::Parameters::from_slice(&values); 2];
        for (index, &mounting) in mountings.iter().enumerate() {
            let mut columns = Vec::with_capacity(n_columns);
            for column in 0..n_columns {
                columns.push(R::from_fn(|lane| {
                    let draw = batch.runs[runs[lane.min(last)]].draw as usize;
                    theta[(draw * mountings.len() + index) * n_columns + column]
                }));
            }
            let merged = mounting.differential && M::SPEC.odd && M::SPEC.offset_adds;
            let dampers = match (merged, mounting.differential) {
                (true, _) => vec![DamperStates::at_rest(1.0, 2.0 * mounting.count)],
                (false, true) => [1.0, -1.0].map(|side| DamperStates::at_rest(side, mounting.count)).into(),
                (false, false) => vec![DamperStates::at_rest(1.0, mounting.count)],
            };
            devices.push(Device {
                columns,
                values: values.clone(),
                command: R::splat(0.0),
                decay: R::splat(0.0),
                cancelled: if merged { offsets(M::SPEC.parameters) } else { Vec::new() },
                at,
                dampers,
            });
        }
        let mut dampers = Self {
            laws,
            follows: !laws.are_constant(),
            lagged: laws.lag_column().is_some(),
            force: vec![R::splat(0.0); devices.len()],
            current: vec![R::splat(0.0); devices.len()],
            devices,
        };
        R::out_of_line(PrepareDrivers { dampers: &mut dampers, step });
        dampers
    }

    /// Passes the commands to the drivers; returns whether the forces change at once.
    pub(super) fn receive(&mut self, commands: &[R], at_once: bool) -> bool {
        let jumps = at_once || !self.lagged;
        R::out_of_line(ReceiveCommands { dampers: self, commands, jumps });
        jumps
    }

    /// Evaluates the parameters in the middle and at the end of the step.
    pub(super) fn advance_drivers(&mut self) {
        if self.follows {
            R::out_of_line(AdvanceDrivers { dampers: self });
        }
    }

    /// Evaluates forces and state rates at these elongations and rates, with the parameters of `moment`.
    pub(super) fn evaluate_forces(&mut self, elongation: &[R], rate: &[R], moment: usize) {
        R::out_of_line(EvaluateForces { dampers: self, elongation, rate, moment });
    }

    /// Adds the weighted state rates of a stage to the step and moves `reach` ahead for the next; zero ends the step.
    pub(super) fn advance(&mut self, weight: f64, reach: f64) {
        if M::SPEC.n_states > 0 {
            R::out_of_line(AdvanceStates { dampers: self, weight, reach });
        }
    }

    /// Evaluates the parameters of a device at its current and stores them for `moment`.
    #[inline(always)]
    fn evaluate(&mut self, device: usize, moment: usize) {
        let own = &mut self.devices[device];
        self.laws.follow(&own.columns, self.current[device], &mut own.values);
        for &parameter in &own.cancelled {
            own.values[parameter] = R::splat(0.0);
        }
        own.at[moment].follow(&own.values, self.laws.follows());
    }
}

/// Before the first step: the decay of each lag, and the parameters at zero current.
struct PrepareDrivers<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
    step: f64,
}

impl<M: DamperModel, R: Lanes> OutOfLine for PrepareDrivers<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        for index in 0..self.dampers.devices.len() {
            let device = &mut self.dampers.devices[index];
            if let Some(column) = self.dampers.laws.lag_column() {
                device.decay = exp(device.columns[column] * R::splat(-0.5 * self.step));
            }
            self.dampers.laws.prepare(&mut device.columns);
            self.dampers.laws.evaluate(&device.columns, R::splat(0.0), &mut device.values);
            for &parameter in &device.cancelled {
                device.values[parameter] = R::splat(0.0);
            }
            device.at = [M::Parameters::from_slice(&device.values); 2];
        }
    }
}

struct ReceiveCommands<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
    commands: &'a [R],
    jumps: bool,
}

impl<M: DamperModel, R: Lanes> OutOfLine for ReceiveCommands<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { dampers, commands, jumps } = self;
        for (device, &command) in commands.iter().enumerate() {
            dampers.devices[device].command = command;
            if jumps {
                dampers.current[device] = command;
                if dampers.follows {
                    dampers.evaluate(device, END);
                }
            }
        }
    }
}

struct AdvanceDrivers<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
}

impl<M: DamperModel, R: Lanes> OutOfLine for AdvanceDrivers<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { dampers } = self;
        for index in 0..dampers.devices.len() {
            let device = &mut dampers.devices[index];
            let (command, decay) = (device.command, device.decay);
            if dampers.lagged {
                for moment in [MIDDLE, END] {
                    dampers.current[index] = (dampers.current[index] - command).mul_add(decay, command);
                    dampers.evaluate(index, moment);
                }
            } else {
                device.at[MIDDLE] = device.at[END];
            }
        }
    }
}

struct EvaluateForces<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
    elongation: &'a [R],
    rate: &'a [R],
    moment: usize,
}

impl<M: DamperModel, R: Lanes> OutOfLine for EvaluateForces<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let Self { dampers, elongation, rate, moment } = self;
        for (index, device) in dampers.devices.iter_mut().enumerate() {
            let mut sum = R::splat(0.0);
            for states in &mut device.dampers {
                // Else all parameters would be read before the loop, more than there are registers.
                let p = black_box(&device.at[moment]);
                let side = R::splat(states.side);
                let motion = Motion { displacement: elongation[index] * side, velocity: rate[index] * side };
                sum = M::force(p, states.staged, motion).mul_add(R::splat(states.share), sum);
                if M::SPEC.n_states > 0 {
                    states.rate = M::rate(p, states.staged, motion);
                }
            }
            dampers.force[index] = sum;
        }
    }
}

struct AdvanceStates<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut Dampers<'b, M, R>,
    weight: f64,
    reach: f64,
}

impl<M: DamperModel, R: Lanes> OutOfLine for AdvanceStates<'_, '_, M, R> {
    #[inline(always)]
    fn run(self) {
        let (weight, reach) = (R::splat(self.weight), R::splat(self.reach));
        let ends = self.reach == 0.0;
        for device in &mut self.dampers.devices {
            for states in &mut device.dampers {
                states.next = states.next.advance(weight, states.rate);
                if ends {
                    states.now = states.next;
                }
                states.staged = states.now.advance(reach, states.rate);
            }
        }
    }
}
