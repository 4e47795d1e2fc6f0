//! The controller's own model of the loop, which may differ from the loop that is simulated.

use crate::building::Building;
use crate::coupled::{Group, n_devices};
use crate::error::DynamicsError;

/// A building with dampers as a controller believes them to be; its passive elements are predicted with it.
#[derive(Clone)]
pub struct LoopModel<'a> {
    /// Its building, with the rows of the devices.
    pub building: &'a Building,
    /// Its dampers, of which it believes the first draw.
    pub dampers: Vec<Group<'a>>,
}

impl LoopModel<'_> {
    /// Refuses a model of another number of coordinates or devices than the loop has, or without parameters.
    pub(crate) fn check(&self, building: &Building, expected: usize) -> Result<(), DynamicsError> {
        let sizes = [
            ("coordinates of the controller's model", self.building.n, building.n),
            ("floors of the controller's model", self.building.n_floors(), building.n_floors()),
            ("devices of the controller's model", self.building.n_devices(), expected),
            ("dampers of the controller's model", n_devices(&self.dampers), expected),
        ];
        for (name, found, expected) in sizes {
            if found != expected {
                return Err(DynamicsError::MatrixSize { name, found, expected });
            }
        }
        for group in &self.dampers {
            if group.n_draws().is_none_or(|count| count == 0) {
                let (name, found) = ("theta of the controller's model", group.theta.len());
                let expected = group.mountings.len() * group.laws.n_columns();
                return Err(DynamicsError::MatrixSize { name, found, expected });
            }
        }
        Ok(())
    }
}
