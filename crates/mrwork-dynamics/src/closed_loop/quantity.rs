//! Description of the numbers that a run returns: name, axis, unit.

use crate::building::Building;

/// Axis of a quantity: what it has one number for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// One number.
    Run,
    /// One per floor.
    Floor,
    /// One per storey.
    Storey,
    /// One per device.
    Device,
    /// One per passive element of the building.
    Element,
    /// One per state: displacement, then velocity, of every coordinate.
    State,
}

impl Axis {
    /// Its name in Python.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Floor => "floor",
            Self::Storey => "storey",
            Self::Device => "device",
            Self::Element => "element",
            Self::State => "state",
        }
    }

    /// Its length for a building.
    #[must_use]
    pub fn length(self, building: &Building) -> usize {
        match self {
            Self::Run => 1,
            Self::Floor => building.n_floors(),
            Self::Storey => building.n_storeys(),
            Self::Device => building.n_devices(),
            Self::Element => building.n_elements(),
            Self::State => 2 * building.n_coordinates(),
        }
    }
}

/// A quantity of a run or a signal of its history.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    /// Name.
    pub name: &'static str,
    /// What it has one number for.
    pub axis: Axis,
    /// SI unit.
    pub unit: &'static str,
    /// Definition.
    pub description: &'static str,
}

impl Quantity {
    pub(super) const fn new(
        name: &'static str,
        axis: Axis,
        unit: &'static str,
        description: &'static str,
    ) -> Self {
        Self { name, axis, unit, description }
    }
}

/// Columns of an array that holds these quantities side by side.
#[must_use]
pub fn width(quantities: &[Quantity], building: &Building) -> usize {
    quantities.iter().map(|quantity| quantity.axis.length(building)).sum()
}
