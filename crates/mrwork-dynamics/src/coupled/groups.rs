//! Groups of dampers side by side in a building, each of a model of its own.

use super::devices::{DamperDevices, DeviceState, Devices, Mounting};
use super::slopes::steepest_slopes;
use crate::any_damper::Damper;
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Severity};
use crate::damper::{ModelVisitor, visit};
use crate::error::DynamicsError;
use crate::lanes::Lanes;

/// Number of commands in the range of a device at which slopes and rates are evaluated.
const COMMAND_LEVELS: u32 = 9;

/// Dampers of one model with laws of one form, in devices that follow one another.
#[derive(Clone, Copy)]
pub struct Group<'a> {
    /// The model of the dampers.
    pub damper: &'static dyn Damper,
    /// Current law of each damper parameter.
    pub laws: &'a CurrentLaws,
    /// Damper parameters, shape (draws, devices of the group, columns).
    pub theta: &'a [f64],
    /// Number and arrangement of the dampers of each device.
    pub mountings: &'a [Mounting],
}

impl<'a> Group<'a> {
    /// Number of rows of parameters; `None` if the numbers of parameters do not make whole rows.
    pub(crate) fn n_draws(&self) -> Option<usize> {
        let row = self.mountings.len() * self.laws.n_columns();
        self.theta.len().is_multiple_of(row.max(1)).then(|| self.theta.len().checked_div(row).unwrap_or(1))
    }

    /// Parameters of a device in a draw.
    pub(crate) fn theta_of(&self, draw: usize, device: usize) -> &'a [f64] {
        let n_columns = self.laws.n_columns();
        &self.theta[(draw * self.mountings.len() + device) * n_columns..][..n_columns]
    }

    /// Commands in the range of a device at which slopes and rates are evaluated.
    fn commands(&self, [smallest, largest]: [f64; 2]) -> Vec<f64> {
        if self.laws.are_constant() {
            return vec![smallest];
        }
        let spacing = (largest - smallest) / f64::from(COMMAND_LEVELS - 1);
        (0..COMMAND_LEVELS).map(|level| f64::from(level).mul_add(spacing, smallest)).collect()
    }
}

/// Number of devices of all groups.
pub(crate) fn n_devices(groups: &[Group<'_>]) -> usize {
    groups.iter().map(|group| group.mountings.len()).sum()
}

/// The device of each number: its group, and its place there.
fn placed<'a, 'b>(groups: &'b [Group<'a>]) -> impl Iterator<Item = (&'b Group<'a>, usize)> {
    groups.iter().flat_map(|group| (0..group.mountings.len()).map(move |device| (group, device)))
}

/// Mounting of each device.
pub(crate) fn mountings<'b>(groups: &'b [Group<'_>]) -> impl Iterator<Item = Mounting> + 'b {
    placed(groups).map(|(group, device)| group.mountings[device])
}

/// What dampers with these parameters and ranges of the command add to the rate of a building whose masses they move:
/// of their stiffness [1/s2], and of their damping [1/s].
pub(crate) fn added_rates(
    groups: &[Group<'_>],
    draw: usize,
    ranges: &[[f64; 2]],
    masses: &[f64],
) -> (f64, f64) {
    let (mut stiffening, mut decay) = (0.0, 0.0);
    for (((group, device), &range), &mass) in placed(groups).zip(ranges).zip(masses) {
        let theta = group.theta_of(draw, device);
        let [over_velocity, over_displacement] =
            steepest_slopes(group.damper, group.laws, theta, &group.commands(range));
        let mounting = group.mountings[device];
        let dampers = mounting.count * if mounting.differential { 2.0 } else { 1.0 };
        decay += dampers * over_velocity / mass;
        stiffening += dampers * over_displacement / mass;
    }
    (stiffening, decay)
}

/// Largest relaxation rate of the damper states [1/s], under a severity of the motion for each device; a bound that is
/// not a number is kept.
pub(crate) fn relaxation_bound(
    groups: &[Group<'_>],
    draw: usize,
    ranges: &[[f64; 2]],
    severity: impl Fn(usize) -> Severity,
) -> f64 {
    let mut bound = 0.0;
    for (number, ((group, device), &range)) in placed(groups).zip(ranges).enumerate() {
        let theta = group.theta_of(draw, device);
        let own = group.damper.stiffness_bound(theta, group.laws, &group.commands(range), severity(number));
        if own > bound || own.is_nan() {
            bound = own;
        }
    }
    bound
}

/// The devices of all groups before the first command; `column` is an entry of the parameters of a device of a group.
///
/// # Errors
/// For a model that is not registered.
pub(crate) fn devices_at_rest<'a, R: Lanes + 'a>(
    groups: &[Group<'a>],
    column: impl Fn(&Group<'a>, usize, usize) -> R,
) -> Result<Box<dyn Devices<R> + 'a>, DynamicsError> {
    let mut each = Vec::with_capacity(groups.len());
    for group in groups {
        let Group { damper, laws, mountings, .. } = *group;
        let columns_of = |device| (0..laws.n_columns()).map(|number| column(group, device, number)).collect();
        let columns = (0..mountings.len()).map(columns_of).collect();
        let name = damper.spec().name;
        let own = visit(name, AtRest { laws, mountings, columns });
        each.push(own.ok_or(DynamicsError::UnknownDevice(name))?);
    }
    Ok(if each.len() == 1 { each.remove(0) } else { Box::new(SideBySide::new(each)) })
}

struct AtRest<'a, R> {
    laws: &'a CurrentLaws,
    mountings: &'a [Mounting],
    columns: Vec<Vec<R>>,
}

impl<'a, R: Lanes + 'a> ModelVisitor<Box<dyn Devices<R> + 'a>> for AtRest<'a, R> {
    fn visit<M: DamperModel + 'static>(self, model: M) -> Box<dyn Devices<R> + 'a> {
        Box::new(DamperDevices::at_rest(model, self.laws, self.mountings, self.columns))
    }
}

/// The devices of several groups, one group after the other.
struct SideBySide<'a, R> {
    groups: Vec<Box<dyn Devices<R> + 'a>>,
    force: Vec<R>,
    current: Vec<R>,
    scale: Vec<R>,
}

impl<'a, R: Lanes + 'a> SideBySide<'a, R> {
    fn new(groups: Vec<Box<dyn Devices<R> + 'a>>) -> Self {
        let zeros = vec![R::splat(0.0); groups.iter().map(|group| group.force().len()).sum()];
        let scale = vec![R::splat(1.0); zeros.len()];
        Self { groups, force: zeros.clone(), current: zeros, scale }
    }

    /// Takes the currents of the groups.
    fn take_currents(&mut self) {
        let mut first = 0;
        for group in &self.groups {
            let own = group.current();
            self.current[first..first + own.len()].copy_from_slice(own);
            first += own.len();
        }
    }
}

impl<'a, R: Lanes + 'a> Devices<R> for SideBySide<'a, R> {
    fn force(&self) -> &[R] {
        &self.force
    }

    fn fastest(&self) -> Vec<R> {
        self.groups.iter().flat_map(|group| group.fastest()).collect()
    }

    fn current(&self) -> &[R] {
        &self.current
    }

    fn scale(&mut self) -> &mut [R] {
        &mut self.scale
    }

    fn set_step(&mut self, step: f64) {
        self.groups.iter_mut().for_each(|group| group.set_step(step));
    }

    fn receive(&mut self, commands: &[R], at_once: bool) -> bool {
        let (mut first, mut jumps) = (0, false);
        for group in &mut self.groups {
            let count = group.force().len();
            jumps |= group.receive(&commands[first..first + count], at_once);
            first += count;
        }
        self.take_currents();
        jumps
    }

    fn advance_drivers(&mut self) {
        self.groups.iter_mut().for_each(|group| group.advance_drivers());
        self.take_currents();
    }

    fn evaluate(&mut self, elongation: &[R], rate: &[R], moment: usize) {
        let mut first = 0;
        for group in &mut self.groups {
            let own = first..first + group.force().len();
            group.scale().copy_from_slice(&self.scale[own.clone()]);
            group.evaluate(&elongation[own.clone()], &rate[own.clone()], moment);
            first = own.end;
            self.force[own].copy_from_slice(group.force());
        }
    }

    fn advance(&mut self, weight: f64, reach: f64) {
        self.groups.iter_mut().for_each(|group| group.advance(weight, reach));
    }

    fn save(&self, into: &mut DeviceState<R>) {
        into.groups.resize_with(self.groups.len(), DeviceState::default);
        self.groups.iter().zip(&mut into.groups).for_each(|(group, own)| group.save(own));
    }

    fn restore(&mut self, from: &DeviceState<R>) {
        self.groups.iter_mut().zip(&from.groups).for_each(|(group, own)| group.restore(own));
        self.take_currents();
    }
}
