//! The controller's own model of the loop, which may differ from the loop that is simulated.

use crate::any_damper::Damper;
use crate::building::Building;
use crate::coupled::Mounting;
use crate::current_law::CurrentLaws;
use crate::error::DynamicsError;

/// A building with dampers as a controller believes them to be; passive elements are those in its matrices.
#[derive(Clone, Copy)]
pub struct LoopModel<'a> {
    /// Its building, with the rows of the devices.
    pub building: &'a Building,
    /// Its model of the dampers.
    pub damper: &'static dyn Damper,
    /// Current law of each damper parameter.
    pub laws: &'a CurrentLaws,
    /// Damper parameters, shape (devices, columns).
    pub theta: &'a [f64],
    /// Number and arrangement of the dampers of each device.
    pub mountings: &'a [Mounting],
}

impl<'a> LoopModel<'a> {
    /// Parameters of a device.
    pub(crate) fn theta_of(&self, device: usize) -> &'a [f64] {
        let n_columns = self.laws.n_columns();
        &self.theta[device * n_columns..][..n_columns]
    }

    /// Refuses a model of another number of coordinates or devices than the loop has.
    pub(crate) fn check(&self, n_coordinates: usize, n_devices: usize) -> Result<(), DynamicsError> {
        let sizes = [
            ("coordinates of the controller's model", self.building.n, n_coordinates),
            ("devices of the controller's model", self.building.n_devices(), n_devices),
            ("dampers of the controller's model", self.mountings.len(), n_devices),
            ("theta of the controller's model", self.theta.len(), n_devices * self.laws.n_columns()),
        ];
        for (name, found, expected) in sizes {
            if found != expected {
                return Err(DynamicsError::MatrixSize { name, found, expected });
            }
        }
        Ok(())
    }
}
