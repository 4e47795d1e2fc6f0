//! A control law in Python, asked at every control sample for all runs of a block together.
//!
//! Only the calling thread asks, between two samples and never within a time step; the simulation waits for the answer.

use std::sync::{Mutex, PoisonError};

use mrwork_dynamics::closed_loop::{BlockSample, OutsideLaw};
use numpy::ndarray::Ix2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::arrays::{array_of, shaped};

/// The law, and its first error.
///
/// It is called with the number of the sample, the places of the runs in the batch, displacements and velocities, shape
/// (runs, coordinates), elongations, their rates and forces of the devices, shape (runs, devices), absolute
/// accelerations of the floors, shape (runs, floors), acceleration and velocity of the ground, shape (runs,), and the drifts of
/// the measured storeys, shape (runs, measured storeys), and whether all of these are numbers; it returns the commands, shape (runs, devices).
pub struct AskedLaw {
    law: Py<PyAny>,
    n_coordinates: usize,
    n_devices: usize,
    n_floors: usize,
    error: Mutex<Option<PyErr>>,
}

impl AskedLaw {
    /// The law before the first sample.
    pub fn new(law: Py<PyAny>, n_coordinates: usize, n_devices: usize, n_floors: usize) -> Self {
        Self { law, n_coordinates, n_devices, n_floors, error: Mutex::new(None) }
    }

    /// Whether the law raised an error: the simulation then ends.
    pub fn failed(&self) -> bool {
        self.error.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// The error that the law raised.
    pub fn error(&self) -> Option<PyErr> {
        self.error.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn ask(&self, py: Python<'_>, sample: &BlockSample<'_>, commands: &mut [f64]) -> PyResult<()> {
        let n_runs = sample.runs.len();
        let matrix = |values: &[f64], columns: usize| -> PyResult<Bound<'_, PyArray2<f64>>> {
            Ok(array_of(Ix2(n_runs, columns), values.to_vec())?.into_pyarray(py))
        };
        let measured = [
            sample.displacement,
            sample.velocity,
            sample.deformation,
            sample.rate,
            sample.force,
            sample.acceleration,
            sample.ground_acceleration,
            sample.ground_velocity,
            sample.drift,
        ];
        let arguments = (
            sample.number,
            sample.runs.to_vec().into_pyarray(py),
            matrix(sample.displacement, self.n_coordinates)?,
            matrix(sample.velocity, self.n_coordinates)?,
            matrix(sample.deformation, self.n_devices)?,
            matrix(sample.rate, self.n_devices)?,
            matrix(sample.force, self.n_devices)?,
            matrix(sample.acceleration, self.n_floors)?,
            sample.ground_acceleration.to_vec().into_pyarray(py),
            sample.ground_velocity.to_vec().into_pyarray(py),
            matrix(sample.drift, sample.drift.len() / n_runs.max(1))?,
            !measured.into_iter().flatten().any(|reading| reading.is_nan()),
        );
        let answer = self.law.bind(py).call1(arguments)?;
        let answer: PyReadonlyArray2<'_, f64> = answer.extract()?;
        let axes = [("runs", Some(n_runs)), ("devices", Some(self.n_devices))];
        commands.copy_from_slice(shaped("commands", &answer, &axes)?);
        Ok(())
    }
}

impl OutsideLaw for AskedLaw {
    fn command(&self, sample: &BlockSample<'_>, commands: &mut [f64]) {
        if self.failed() {
            return;
        }
        if let Err(error) = Python::attach(|py| self.ask(py, sample, commands)) {
            *self.error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        }
    }
}
