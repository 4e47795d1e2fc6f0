//! Full histories of a run, on request: one row per control sample.

use super::reductions::Reductions;
use crate::building::Building;
use crate::lanes::{Apart, Lanes};

/// Signals in the order in which they are written, with how many numbers each has.
#[must_use]
pub fn layout(building: &Building) -> Vec<(&'static str, usize)> {
    let (n, floors, storeys, devices) =
        (building.n, building.n_floors(), building.n_storeys(), building.n_devices());
    vec![
        ("ground_acceleration", 1),
        ("state", 2 * n),
        ("displacement", floors),
        ("acceleration", floors),
        ("drift", storeys),
        ("deformation", devices),
        ("rate", devices),
        ("force", devices),
        ("command", devices),
        ("current", devices),
        ("device_energy", devices),
        ("input_energy", 1),
        ("damping_energy", 1),
    ]
}

/// The histories of one run, sample by sample.
pub struct History<'a> {
    /// Shape (samples, width of the layout).
    pub(super) rows: &'a mut [f64],
    /// Width of the layout.
    pub(super) width: usize,
}

/// Writes a sample of all lanes.
pub(super) struct Record<'a, 'b, R> {
    pub(super) building: &'a Building,
    pub(super) sample: usize,
    pub(super) displacement: &'a [R],
    pub(super) velocity: &'a [R],
    pub(super) acceleration: &'a [R],
    pub(super) force: &'a [R],
    pub(super) current: &'a [R],
    pub(super) command: &'a [R],
    pub(super) ground_acceleration: R,
    pub(super) reductions: &'a Reductions<R>,
    pub(super) rows: &'a mut [History<'b>],
}

impl<R: Lanes> Apart for Record<'_, '_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { building, sample, displacement, velocity, acceleration, force, .. } = self;
        let mut writer = Writer { rows: self.rows, sample, column: 0 };
        writer.put(self.ground_acceleration);
        writer.put_all(displacement);
        writer.put_all(velocity);
        for floor in 0..building.n_floors() {
            writer.put(building.floors.dot(floor, displacement));
        }
        for floor in 0..building.n_floors() {
            writer.put(building.floors.add_dot(floor, acceleration, self.ground_acceleration));
        }
        for storey in 0..building.n_storeys() {
            writer.put(building.storeys.dot(storey, displacement));
        }
        for device in 0..force.len() {
            writer.put(building.devices.dot(device, displacement));
        }
        for device in 0..force.len() {
            writer.put(building.devices.dot(device, velocity));
        }
        writer.put_all(force);
        writer.put_all(self.command);
        writer.put_all(self.current);
        writer.put_all(&self.reductions.device_work);
        writer.put(self.reductions.input);
        writer.put(self.reductions.damping);
    }
}

struct Writer<'a, 'b> {
    rows: &'a mut [History<'b>],
    sample: usize,
    column: usize,
}

impl Writer<'_, '_> {
    #[inline(always)]
    fn put<R: Lanes>(&mut self, value: R) {
        value.for_each(|lane, value| {
            if let Some(history) = self.rows.get_mut(lane) {
                history.rows[self.sample * history.width + self.column] = value;
            }
        });
        self.column += 1;
    }

    #[inline(always)]
    fn put_all<R: Lanes>(&mut self, values: &[R]) {
        for &value in values {
            self.put(value);
        }
    }
}

/// Numbers of a sample.
#[must_use]
pub(super) fn width(building: &Building) -> usize {
    layout(building).iter().map(|&(_, count)| count).sum()
}
