//! Histories of a run, on request: one row per control sample, and one for the end of the last.

use super::quantity::{Axis, Quantity};
use super::reductions::Reductions;
use crate::building::Building;
use crate::coupled::{Coupled, PlantMotion};
use crate::lanes::Lanes;
use crate::real::OutOfLine;

/// Signals of a history, in order; energies are accumulated from the start of the run.
pub const HISTORY_SIGNALS: &[Quantity] = &[
    Quantity::new("ground_acceleration", Axis::Run, "m/s^2", "acceleration of the ground"),
    Quantity::new("state", Axis::State, "m, m/s", "displacement, then velocity, of every coordinate"),
    Quantity::new("displacement", Axis::Floor, "m", "displacement relative to the ground"),
    Quantity::new("acceleration", Axis::Floor, "m/s^2", "absolute acceleration"),
    Quantity::new("drift", Axis::Storey, "m", "drift"),
    Quantity::new("deformation", Axis::Device, "m", "damper displacement"),
    Quantity::new("rate", Axis::Device, "m/s", "damper velocity"),
    Quantity::new("force", Axis::Device, "N", "resisting force"),
    Quantity::new("command", Axis::Device, "A or V", "command sent"),
    Quantity::new("current", Axis::Device, "A or V", "command behind the lag of the driver"),
    Quantity::new("device_energy", Axis::Device, "J", "energy dissipated"),
    Quantity::new("element_deformation", Axis::Element, "m", "displacement across the passive element"),
    Quantity::new("element_force", Axis::Element, "N", "its resisting force, with spring and dashpot"),
    Quantity::new("element_energy", Axis::Element, "J", "work on it, but for its spring"),
    Quantity::new("input_energy", Axis::Run, "J", "work of the ground and of forces on floors"),
    Quantity::new("damping_energy", Axis::Run, "J", "energy dissipated by the damping of the building"),
];

/// Columns of a history.
pub(super) fn width(building: &Building) -> usize {
    super::quantity::width(HISTORY_SIGNALS, building)
}

/// Output array of the history of one run.
pub struct HistoryRows<'a> {
    /// Shape (samples, width).
    pub(super) rows: &'a mut [f64],
    /// Columns.
    pub(super) width: usize,
}

/// Writes one sample of all lanes, in the order of [`HISTORY_SIGNALS`].
pub(super) struct WriteHistory<'a, 'b, 'c, R: Lanes> {
    pub(super) building: &'a Building,
    pub(super) sample: usize,
    pub(super) coupled: &'a Coupled<'b, R>,
    pub(super) command: &'a [R],
    /// Acceleration of the ground by the record, and that at which the motion was evaluated.
    pub(super) record: R,
    pub(super) ground_acceleration: R,
    pub(super) reductions: &'a Reductions<R>,
    pub(super) rows: &'a mut [HistoryRows<'c>],
}

impl<R: Lanes> OutOfLine for WriteHistory<'_, '_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { building, sample, coupled: Coupled { plant, devices }, .. } = self;
        let (motion, force) = (plant.motion(), devices.force());
        let PlantMotion { displacement, velocity, acceleration, .. } = motion;
        let mut writer = Writer { rows: self.rows, sample, column: 0 };
        writer.put(self.record);
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
        writer.put_all(devices.current());
        writer.put_all(&self.reductions.energies.devices);
        for column in [0, 2] {
            for element in 0..building.n_elements() {
                writer.put(motion.of_element(building, element)[column]);
            }
        }
        writer.put_all(&self.reductions.energies.with_dashpots);
        writer.put(self.reductions.energies.input);
        writer.put(self.reductions.energies.damping_alone());
    }
}

struct Writer<'a, 'b> {
    rows: &'a mut [HistoryRows<'b>],
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
