//! The devices of a building in lanes: damper states, and damper parameters as functions of the coil current.

use core::hint::black_box;

use super::stages::{END, MIDDLE};
use crate::current_law::{CurrentLaws, Evaluate, Follow, Prepare};
use crate::damper::model::{DamperModel, Motion, State};
use crate::lag::Decay;
use crate::lanes::Lanes;
use crate::parameters::{FromSlice, offsets};
use crate::real::{OutOfLine, Real, finite_or_infinite};

/// Number and arrangement of the dampers of a device.
#[derive(Clone, Copy, Debug)]
pub struct Mounting {
    /// Dampers in parallel.
    pub count: f64,
    /// Whether the same number acts in opposition (a differential pair).
    pub differential: bool,
}

/// The devices of a building, whatever their model: every call is for all lanes of a block, so that a loop is compiled
/// once for all models.
pub(crate) trait Devices<R> {
    /// Force with which each device resists, as evaluated last [N].
    fn force(&self) -> &[R];
    /// Fastest relaxation of the states of each device so far [1/s], zero of a model that is not watched.
    fn fastest(&self) -> Vec<R>;
    /// Current in each coil: the command behind the lag of the driver.
    fn current(&self) -> &[R];
    /// Factors on the forces.
    fn scale(&mut self) -> &mut [R];
    /// Sets the length of a step [s].
    fn set_step(&mut self, step: f64);
    /// Passes the commands to the drivers; returns whether the forces change at once.
    fn receive(&mut self, commands: &[R], at_once: bool) -> bool;
    /// Evaluates the parameters in the middle and at the end of the step.
    fn advance_drivers(&mut self);
    /// Evaluates forces and state rates at these elongations and rates, with the parameters of `moment`.
    fn evaluate(&mut self, elongation: &[R], rate: &[R], moment: usize);
    /// Adds the weighted state rates of a stage to the step and moves `reach` ahead for the next; zero ends the step.
    fn advance(&mut self, weight: f64, reach: f64);
    /// Writes currents and damper states, between two steps.
    fn save(&self, into: &mut DeviceState<R>);
    /// Goes on from these currents and damper states.
    fn restore(&mut self, from: &DeviceState<R>);
}

/// Coil currents, and states of the dampers one after the other, or those of each group; empty where nothing was saved.
#[derive(Clone)]
pub(crate) struct DeviceState<R> {
    current: Vec<R>,
    states: Vec<R>,
    pub(super) groups: Vec<Self>,
}

impl<R> Default for DeviceState<R> {
    fn default() -> Self {
        Self { current: Vec::new(), states: Vec::new(), groups: Vec::new() }
    }
}

impl<R> DeviceState<R> {
    /// Visits each number.
    pub(crate) fn each(&mut self, visit: &mut dyn FnMut(&mut R)) {
        self.current.iter_mut().chain(&mut self.states).for_each(&mut *visit);
        self.groups.iter_mut().for_each(|group| group.each(visit));
    }
}

/// Devices whose dampers are of one model, each of one damper or of two in opposition.
pub(crate) struct DamperDevices<'a, M: DamperModel, R: Real> {
    model: M,
    laws: &'a CurrentLaws,
    follows: bool,
    devices: Vec<Device<M, R>>,
    force: Vec<R>,
    current: Vec<R>,
    scale: Vec<R>,
    fastest: Vec<R>,
    step: f64,
    /// Whether the next forces are those at the start of a step.
    begins: bool,
}

struct Device<M: DamperModel, R: Real> {
    /// Prepared.
    columns: Vec<R>,
    /// Parameters at the present current.
    values: Vec<R>,
    /// Command that the driver receives.
    command: R,
    decay: Decay<R>,
    /// Parameters that count as zero: two dampers in opposition are computed as one with twice the force and no offset.
    cancelled: Vec<usize>,
    /// Parameters in the middle and at the end of a step; the start is the end of the step before.
    at: [M::Parameters<R>; 2],
    dampers: Vec<DamperStates<M, R>>,
}

/// States of the dampers on one side of a device, during the stages of a step.
struct DamperStates<M: DamperModel, R: Real> {
    /// Number of dampers, negative for those that shorten when the device lengthens.
    share: f64,
    now: M::State<R>,
    staged: M::State<R>,
    rate: M::State<R>,
    next: M::State<R>,
}

impl<M: DamperModel, R: Real> DamperStates<M, R> {
    #[inline(always)]
    fn at_rest(share: f64) -> Self {
        let rest = M::State::splat(R::splat(0.0));
        Self { share, now: rest, staged: rest, rate: rest, next: rest }
    }
}

impl<'a, M: DamperModel, R: Lanes> DamperDevices<'a, M, R> {
    /// Dampers at rest, before the first command; `columns` are those of `theta` of each device.
    pub(crate) fn at_rest(
        model: M,
        laws: &'a CurrentLaws,
        mountings: &[Mounting],
        columns: Vec<Vec<R>>,
    ) -> Self {
        let zeros = vec![R::splat(0.0); mountings.len()];
        let mut dampers = DamperDevices {
            model,
            laws,
            follows: !laws.are_constant(),
            devices: Vec::with_capacity(mountings.len()),
            force: zeros.clone(),
            current: zeros.clone(),
            scale: vec![R::splat(1.0); mountings.len()],
            fastest: zeros,
            step: 0.0,
            begins: true,
        };
        R::out_of_line(AtRest { mountings, columns, dampers: &mut dampers });
        dampers
    }

    /// Evaluates the parameters of a device at its current and stores them for `moment`.
    #[inline(always)]
    fn follow(&mut self, device: usize, moment: usize) {
        let own = &mut self.devices[device];
        R::out_of_line(Follow {
            laws: self.laws,
            prepared: &own.columns,
            current: &self.current[device],
            values: &mut own.values,
        });
        R::out_of_line(TakeParameters { laws: self.laws, device: own, moment });
    }
}

impl<M: DamperModel, R: Lanes> Devices<R> for DamperDevices<'_, M, R> {
    fn force(&self) -> &[R] {
        &self.force
    }

    fn fastest(&self) -> Vec<R> {
        self.fastest.clone()
    }

    fn current(&self) -> &[R] {
        &self.current
    }

    fn scale(&mut self) -> &mut [R] {
        &mut self.scale
    }

    #[allow(clippy::float_cmp)] // the same number, or another
    fn set_step(&mut self, step: f64) {
        if self.laws.are_lagged() && step != self.step {
            for Device { columns, decay, .. } in &mut self.devices {
                R::out_of_line(SetDecay { rates: self.laws.rates(columns), step, decay });
            }
        }
        self.step = step;
    }

    fn receive(&mut self, commands: &[R], at_once: bool) -> bool {
        let mut jumps = at_once;
        R::out_of_line(ReceiveCommands { dampers: self, commands, jumps: &mut jumps });
        jumps
    }

    fn advance_drivers(&mut self) {
        if self.follows {
            R::out_of_line(AdvanceDrivers { dampers: self });
        }
    }

    fn evaluate(&mut self, elongation: &[R], rate: &[R], moment: usize) {
        R::out_of_line(EvaluateForces { dampers: self, elongation, rate, moment });
    }

    fn advance(&mut self, weight: f64, reach: f64) {
        self.begins = reach == 0.0;
        if M::SPEC.n_states > 0 {
            R::out_of_line(AdvanceStates { dampers: self, weight, reach });
        }
    }

    fn save(&self, into: &mut DeviceState<R>) {
        into.current.clone_from(&self.current);
        into.states.clear();
        for dampers in self.devices.iter().flat_map(|device| &device.dampers) {
            dampers.now.for_each(|_, entry| into.states.push(entry));
        }
    }

    fn restore(&mut self, from: &DeviceState<R>) {
        R::out_of_line(Restore { dampers: self, from });
    }
}

/// Fills in the devices, with the parameters at zero current.
struct AtRest<'a, 'b, M: DamperModel, R: Real> {
    mountings: &'b [Mounting],
    columns: Vec<Vec<R>>,
    dampers: &'b mut DamperDevices<'a, M, R>,
}

impl<M: DamperModel, R: Lanes> OutOfLine for AtRest<'_, '_, M, R> {
    type Home = M;
    #[inline(always)]
    fn run(self) {
        let Self { mountings, columns, dampers: DamperDevices { model, laws, devices, .. } } = self;
        for (&mounting, mut columns) in mountings.iter().zip(columns) {
            let merged = mounting.differential && M::SPEC.odd && M::SPEC.offset_adds;
            let count = mounting.count;
            let sides: &[f64] = match (merged, mounting.differential) {
                (true, _) => &[2.0 * count],
                (false, true) => &[count, -count],
                (false, false) => &[count],
            };
            let mut dampers = Vec::with_capacity(sides.len());
            for &share in sides {
                dampers.push(DamperStates::at_rest(share));
            }
            let cancelled = if merged { offsets(M::SPEC.parameters) } else { Vec::new() };
            let mut values = vec![R::splat(f64::NAN); laws.n_params()];
            R::out_of_line(Prepare { laws, columns: &mut columns });
            R::out_of_line(Evaluate {
                laws,
                prepared: &columns,
                current: R::splat(0.0),
                values: &mut values,
            });
            for &parameter in &cancelled {
                values[parameter] = R::splat(0.0);
            }
            let parameters = model.parameters(&values);
            let at = [parameters.clone(), parameters];
            let (command, decay) = (R::splat(0.0), Decay::of(&[], 0.0));
            devices.push(Device { columns, values, command, decay, cancelled, at, dampers });
        }
    }
}

/// Parameters of a device from the values that depend on the current.
struct TakeParameters<'a, M: DamperModel, R: Real> {
    laws: &'a CurrentLaws,
    device: &'a mut Device<M, R>,
    moment: usize,
}

impl<M: DamperModel, R: Lanes> OutOfLine for TakeParameters<'_, M, R> {
    type Home = M;
    #[inline(always)]
    fn run(self) {
        let Self { laws, device, moment } = self;
        for &parameter in &device.cancelled {
            device.values[parameter] = R::splat(0.0);
        }
        device.at[moment].follow(&device.values, laws.follows());
    }
}

struct SetDecay<'a, R> {
    rates: &'a [R],
    step: f64,
    decay: &'a mut Decay<R>,
}

impl<R: Lanes> OutOfLine for SetDecay<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        *self.decay = Decay::of(self.rates, self.step);
    }
}

struct ReceiveCommands<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut DamperDevices<'b, M, R>,
    commands: &'a [R],
    jumps: &'a mut bool,
}

impl<M: DamperModel, R: Lanes> OutOfLine for ReceiveCommands<'_, '_, M, R> {
    type Home = M;
    #[inline(always)]
    fn run(self) {
        let Self { dampers, commands, jumps } = self;
        let at_once = *jumps;
        for (device, &command) in commands.iter().enumerate() {
            dampers.devices[device].command = command;
            // A current that stays leaves the parameters as they are, but not their derivatives.
            let stays = !R::HAS_DERIVATIVES && R::all(command.equal(dampers.current[device]));
            if at_once || !(dampers.laws.are_lagged() || stays) {
                *jumps = true;
                dampers.current[device] = command;
                if dampers.follows {
                    dampers.follow(device, END);
                }
            }
        }
    }
}

struct AdvanceDrivers<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut DamperDevices<'b, M, R>,
}

impl<M: DamperModel, R: Lanes> OutOfLine for AdvanceDrivers<'_, '_, M, R> {
    type Home = M;
    #[inline(always)]
    fn run(self) {
        let Self { dampers } = self;
        for index in 0..dampers.devices.len() {
            let device = &mut dampers.devices[index];
            if dampers.laws.are_lagged() {
                for moment in [MIDDLE, END] {
                    let Device { command, decay, .. } = &dampers.devices[index];
                    dampers.current[index] = decay.moved(dampers.current[index], *command);
                    dampers.follow(index, moment);
                }
            } else {
                let [middle, end] = &mut device.at;
                middle.clone_from(end);
            }
        }
    }
}

struct EvaluateForces<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut DamperDevices<'b, M, R>,
    elongation: &'a [R],
    rate: &'a [R],
    moment: usize,
}

impl<M: DamperModel, R: Lanes> OutOfLine for EvaluateForces<'_, '_, M, R> {
    type Home = M;
    #[inline(always)]
    fn run(self) {
        let Self { dampers, elongation, rate, moment } = self;
        for (index, device) in dampers.devices.iter_mut().enumerate() {
            let mut sum = R::splat(0.0);
            for states in &mut device.dampers {
                // Else all parameters would be read before the loop, more than there are registers.
                let p = black_box(&device.at[moment]);
                let (x, v) = (elongation[index], rate[index]);
                let motion = if states.share < 0.0 {
                    Motion { displacement: -x, velocity: -v }
                } else {
                    Motion { displacement: x, velocity: v }
                };
                sum = M::force(p, states.staged, motion).weighted(R::splat(states.share), sum);
                if M::SPEC.n_states > 0 {
                    states.rate = M::rate(p, states.staged, motion);
                }
                if const { M::WATCHED && !R::HAS_DERIVATIVES } && dampers.begins {
                    let fastest = finite_or_infinite(M::relaxation(p, states.staged, motion));
                    dampers.fastest[index] = fastest.max(dampers.fastest[index]);
                }
            }
            dampers.force[index] = sum * dampers.scale[index];
        }
    }
}

struct AdvanceStates<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut DamperDevices<'b, M, R>,
    weight: f64,
    reach: f64,
}

impl<M: DamperModel, R: Lanes> OutOfLine for AdvanceStates<'_, '_, M, R> {
    type Home = M;
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

struct Restore<'a, 'b, M: DamperModel, R: Real> {
    dampers: &'a mut DamperDevices<'b, M, R>,
    from: &'a DeviceState<R>,
}

impl<M: DamperModel, R: Lanes> OutOfLine for Restore<'_, '_, M, R> {
    type Home = M;
    #[inline(always)]
    fn run(self) {
        let Self { dampers, from } = self;
        dampers.current.copy_from_slice(&from.current);
        let mut first = 0;
        for device in 0..dampers.devices.len() {
            if dampers.follows {
                dampers.follow(device, END);
            }
            for states in &mut dampers.devices[device].dampers {
                let state = M::State::from_fn(|entry| from.states[first + entry]);
                (states.now, states.staged, states.next) = (state, state, state);
                first += M::SPEC.n_states;
            }
        }
    }
}
