//! A control law of a user as a tape, in place of one of the registry.

use crate::control::Measurement;
use crate::lanes::Lanes;
use crate::real::if_known;
use crate::tape::{Tape, Walk};

/// What an input of the tape of a law is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A number that the law keeps from sample to sample.
    Memory,
    /// A setting, which differs by candidate.
    Setting(usize),
    /// Displacement of a coordinate [m].
    Displacement(usize),
    /// Its velocity [m/s].
    Velocity(usize),
    /// Elongation of a commanded device [m].
    Deformation(usize),
    /// Its rate [m/s].
    Rate(usize),
    /// Force with which it resists [N].
    Force(usize),
    /// Absolute acceleration of a floor [m/s^2].
    Acceleration(usize),
    /// Acceleration of the ground [m/s^2].
    GroundAcceleration,
    /// Velocity of the ground [m/s].
    GroundVelocity,
    /// Drift of a measured storey [m].
    Drift(usize),
    /// Time from the start of the motions [s].
    Time,
}

/// An input, and whether the law is without a command where it is not a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Input {
    /// What it is.
    pub source: Source,
    /// Whether its command needs it to be a number.
    pub is_needed: bool,
}

/// A law as a tape: its first inputs and ends are what it keeps, the other ends are the commands.
#[derive(Clone, Debug)]
pub struct OwnLaw {
    /// The formula.
    pub tape: Tape,
    /// Its inputs.
    pub inputs: Vec<Input>,
    /// What it keeps, at the start.
    pub start: Vec<f64>,
    /// Entries of its settings, as `gain[0]`.
    pub names: Vec<String>,
    /// Settings of each candidate, shape (candidates, settings).
    pub settings: Vec<f64>,
}

impl OwnLaw {
    /// Whether it reads the absolute accelerations of floors.
    pub(super) fn reads_acceleration(&self) -> bool {
        self.inputs.iter().any(|input| matches!(input.source, Source::Acceleration(_)))
    }
}

/// A law of a user in the lanes of a block.
pub(super) struct OwnState<'a, R> {
    law: &'a OwnLaw,
    slots: Vec<R>,
    next: Vec<R>,
}

impl<'a, R: Lanes> OwnState<'a, R> {
    /// The law before the first sample, in lanes of these candidates.
    pub(super) fn new(law: &'a OwnLaw, candidate: impl Fn(usize) -> usize) -> Self {
        let mut slots = law.tape.slots::<R>();
        let n_settings = law.names.len();
        for (place, (input, slot)) in law.inputs.iter().zip(&mut slots).enumerate() {
            match input.source {
                Source::Memory => *slot = R::splat(law.start[place]),
                Source::Setting(number) => {
                    *slot = R::from_fn(|lane| law.settings[candidate(lane) * n_settings + number]);
                }
                _ => {}
            }
        }
        Self { law, slots, next: vec![R::splat(0.0); law.start.len()] }
    }
}

impl<R: Lanes> OwnState<'_, R> {
    /// Writes the commands of a sample; none is a number where a reading that the law needs is not.
    #[inline(always)]
    pub(super) fn command(&mut self, measured: &Measurement<'_, R>, number: usize, commands: &mut [R]) {
        let Self { law, slots, next } = self;
        let mut unknown = R::splat(0.0);
        for (place, input) in law.inputs.iter().enumerate() {
            let reading = match input.source {
                Source::Memory | Source::Setting(_) => continue,
                Source::Displacement(index) => measured.displacement[index],
                Source::Velocity(index) => measured.velocity[index],
                Source::Deformation(index) => measured.deformation[index],
                Source::Rate(index) => measured.rate[index],
                Source::Force(index) => measured.force[index],
                Source::Acceleration(index) => measured.acceleration[index],
                Source::GroundAcceleration => measured.ground_acceleration,
                Source::GroundVelocity => measured.ground_velocity,
                Source::Drift(index) => measured.drift[index],
                #[allow(clippy::cast_precision_loss)] // a number of samples
                Source::Time => R::splat(number as f64 * measured.sample_time),
            };
            slots[place] = reading;
            if input.is_needed {
                unknown = R::select(reading.equal(reading), unknown, reading);
            }
        }
        R::out_of_line(Walk { tape: &law.tape, slots });
        for (place, kept) in next.iter_mut().enumerate() {
            *kept = slots[usize::from(law.tape.ends[place])];
        }
        for (place, kept) in next.iter().enumerate() {
            slots[place] = *kept;
        }
        let sent = &law.tape.ends[next.len()..];
        for (device, command) in commands.iter_mut().enumerate() {
            *command = if_known(unknown, slots[usize::from(sent[device])]);
        }
    }

    /// Visits what it keeps.
    pub(super) fn each(&mut self, visit: &mut dyn FnMut(&mut R)) {
        self.slots[..self.next.len()].iter_mut().for_each(visit);
    }

    /// Replaces its settings by values of their names.
    pub(super) fn set(&mut self, mut value: impl FnMut(&str) -> R) {
        for (input, slot) in self.law.inputs.iter().zip(&mut self.slots) {
            if let Source::Setting(number) = input.source {
                *slot = value(&self.law.names[number]);
            }
        }
    }
}
