//! The description of a control law, and the gains of its candidates.

use super::measurement::Measurement;
use crate::real::Real;

/// Shape of a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One per device.
    Device,
    /// One per device and state: displacement of every coordinate, then velocity of every coordinate.
    State,
    /// That many per device.
    Numbers(usize),
    /// One for all devices.
    Loop,
}

/// Numbers on which the shapes of gains depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopSizes {
    /// Number of devices.
    pub n_devices: usize,
    /// Number of states.
    pub n_states: usize,
}

impl Shape {
    /// Its name in the spec.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::State => "state",
            Self::Numbers(_) => "numbers",
            Self::Loop => "loop",
        }
    }

    /// Numbers of a device, where there are several.
    #[must_use]
    pub const fn numbers(self) -> usize {
        match self {
            Self::Numbers(count) => count,
            Self::Device | Self::State | Self::Loop => 1,
        }
    }

    /// Number of entries.
    #[must_use]
    pub const fn size(self, sizes: LoopSizes) -> usize {
        let LoopSizes { n_devices, n_states } = sizes;
        match self {
            Self::Device => n_devices,
            Self::State => n_devices * n_states,
            Self::Numbers(count) => n_devices * count,
            Self::Loop => 1,
        }
    }
}

/// Unit of a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A unit without that of the command.
    Of(&'static str),
    /// That of the command: the gain is itself the command of each device.
    Command,
    /// That of the command, per another unit.
    CommandPer(&'static str),
}

impl Unit {
    /// Its name in the spec.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Of(unit) => unit.to_owned(),
            Self::Command => "A or V".to_owned(),
            Self::CommandPer(unit) => format!("A or V, per {unit}"),
        }
    }

    /// Whether the gain is in proportion to the unit of the command.
    #[must_use]
    pub const fn has_command(self) -> bool {
        !matches!(self, Self::Of(_))
    }
}

/// A gain of a law; candidates may differ in it.
#[derive(Clone, Copy, Debug)]
pub struct GainSpec {
    /// Name.
    pub name: &'static str,
    /// SI unit; for a state gain that of the product with the state.
    pub unit: Unit,
    /// Shape.
    pub shape: Shape,
    /// What it does.
    pub description: &'static str,
}

/// Description of a control law.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools)] // properties of which none excludes another
pub struct LawSpec {
    /// Name in code and on the command line.
    pub name: &'static str,
    /// Name in prose.
    pub title: &'static str,
    /// The law.
    pub equation: &'static str,
    /// Use and limitations of the law.
    pub description: &'static str,
    /// Source of the formula.
    pub source: &'static str,
    /// Gains, in order.
    pub gains: &'static [GainSpec],
    /// Arrays that all candidates share: networks, rule tables.
    pub tables: &'static [&'static str],
    /// Whether it needs the damper force as a function of the command.
    pub needs_curve: bool,
    /// Whether it predicts the motion by a model of the loop, from the state and the ground acceleration.
    pub needs_model: bool,
    /// Whether its command is a force, for a device that exerts it, and not a current or voltage.
    pub commands_force: bool,
    /// Whether it reads the absolute accelerations of floors.
    pub reads_acceleration: bool,
    /// Whether it reads the absolute motion of the sprung mass of a device.
    pub reads_sprung: bool,
    /// Whether its command jumps where a signal changes sign, so that results jump with its gains and have no derivatives.
    pub switches: bool,
}

impl LawSpec {
    /// A law without gains and tables of which no flag is set, for `..LawSpec::PLAIN`.
    pub const PLAIN: Self = Self {
        name: "",
        title: "",
        equation: "",
        description: "",
        source: "",
        gains: &[],
        tables: &[],
        needs_curve: false,
        needs_model: false,
        commands_force: false,
        reads_acceleration: false,
        reads_sprung: false,
        switches: false,
    };

    /// Number of gain entries of one candidate.
    #[must_use]
    pub fn n_gains(&self, sizes: LoopSizes) -> usize {
        self.gains.iter().map(|gain| gain.shape.size(sizes)).sum()
    }
}

/// Gains and tables of a law, in lanes.
pub(crate) struct Gains<'a, R> {
    pub(crate) spec: &'static LawSpec,
    pub(crate) columns: &'a [R],
    pub(crate) tables: &'a [Vec<f64>],
    pub(crate) sizes: LoopSizes,
}

impl<R: Real> Gains<'_, R> {
    #[inline(always)]
    fn start(&self, gain: usize) -> usize {
        let mut start = 0;
        for earlier in &self.spec.gains[..gain] {
            start += earlier.shape.size(self.sizes);
        }
        start
    }

    /// Entry of a device gain.
    #[inline(always)]
    pub(crate) fn of_device(&self, gain: usize, device: usize) -> R {
        self.columns[self.start(gain) + device]
    }

    /// Entry of a gain that all devices share.
    #[inline(always)]
    pub(crate) fn of_loop(&self, gain: usize) -> R {
        self.columns[self.start(gain)]
    }

    /// Entries of a device, of a gain of several numbers for each.
    #[inline(always)]
    pub(crate) fn numbers(&self, gain: usize, device: usize) -> &[R] {
        let count = self.spec.gains[gain].shape.size(LoopSizes { n_devices: 1, ..self.sizes });
        let start = self.start(gain) + device * count;
        &self.columns[start..start + count]
    }

    /// Product of the state gain of a device with the state.
    #[inline(always)]
    pub(crate) fn of_state(&self, gain: usize, device: usize, measured: &Measurement<'_, R>) -> R {
        let start = self.start(gain) + device * self.sizes.n_states;
        let weights = &self.columns[start..start + self.sizes.n_states];
        let (of_displacement, of_velocity) = weights.split_at(measured.displacement.len());
        let mut sum = R::splat(0.0);
        for (coordinate, weight) in of_displacement.iter().enumerate() {
            sum = weight.mul_add(measured.displacement[coordinate], sum);
        }
        for (coordinate, weight) in of_velocity.iter().enumerate() {
            sum = weight.mul_add(measured.velocity[coordinate], sum);
        }
        if let Some(ground) = measured.state_ground {
            // The velocities of the state are `q' + r v_g`.
            for (weight, &share) in of_velocity.iter().zip(measured.influence) {
                sum = weight.mul_add(R::splat(share) * ground, sum);
            }
        }
        sum
    }
}
