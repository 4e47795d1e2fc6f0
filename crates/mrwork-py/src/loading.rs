//! Loading histories in Python.

use mrwork_dynamics::integrate::{MAX_SUBSTEP_FACTOR, MAX_SUBSTEPS};
use mrwork_dynamics::loading::{Command, LoadingHistory as Dynamics};
use numpy::ndarray::{Ix2, Ix3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::{array_of, contiguous};
use crate::enter::{SettingError, refused};
use crate::xla::facts_of;

type Floats<'py> = Bound<'py, PyArray1<f64>>;
type Arguments<'py> = (f64, Floats<'py>, Option<Floats<'py>>, Option<Floats<'py>>);

/// Displacement and velocity on a uniform grid with their C2 cubic splines.
#[pyclass(frozen, module = "mrwork._rust")]
pub struct LoadingHistory {
    pub(crate) dynamics: Dynamics<'static>,
    displacement: Vec<f64>,
    velocity: Option<Vec<f64>>,
}

#[pymethods]
impl LoadingHistory {
    #[new]
    #[pyo3(signature = (dt, displacement, velocity=None, command=None))]
    fn new(
        dt: f64,
        displacement: PyReadonlyArray1<'_, f64>,
        velocity: Option<PyReadonlyArray1<'_, f64>>,
        command: Option<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Self> {
        let displacement = contiguous("displacement", &displacement)?.to_vec();
        let velocity = match velocity {
            Some(velocity) => Some(contiguous("velocity", &velocity)?.to_vec()),
            None => None,
        };
        let mut dynamics = Dynamics::new(dt, &displacement, velocity.as_deref()).map_err(refused)?;
        if let Some(command) = command {
            dynamics = dynamics.with_command(contiguous("command", &command)?).map_err(refused)?;
        }
        Ok(Self { dynamics, displacement, velocity })
    }

    fn __getnewargs__<'py>(&self, py: Python<'py>) -> Arguments<'py> {
        let velocity = self.velocity.as_ref().map(|velocity| velocity.to_pyarray(py));
        (self.dynamics.dt(), self.displacement.to_pyarray(py), velocity, self.command(py))
    }

    fn __repr__(&self) -> String {
        format!("LoadingHistory(dt={}, n_time={})", self.dynamics.dt(), self.dynamics.n_time())
    }

    #[getter]
    fn dt(&self) -> f64 {
        self.dynamics.dt()
    }

    #[getter]
    fn n_time(&self) -> usize {
        self.dynamics.n_time()
    }

    #[getter]
    fn peak_velocity(&self) -> f64 {
        self.dynamics.severity().peak_velocity
    }

    #[getter]
    fn reversal_acceleration(&self) -> f64 {
        self.dynamics.severity().reversal_acceleration
    }

    /// Command [A or V] at the samples, shape (`n_time`,); `None` where none was given.
    #[getter]
    fn command<'py>(&self, py: Python<'py>) -> Option<Floats<'py>> {
        match self.dynamics.command() {
            Command::Held(command) if command.is_nan() => None,
            Command::Held(command) => Some(vec![*command; self.dynamics.n_time()].into_pyarray(py)),
            Command::Varying(command) => Some(command.to_pyarray(py)),
        }
    }

    /// Coefficients of the splines, shape (`n_time` - 1, 8), and the numbers beside them that a simulation needs, (5,).
    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyArray2<f64>>, Floats<'py>)> {
        let coefficients = self.dynamics.coefficients();
        let flat = coefficients.iter().flatten().copied().collect();
        let coefficients = array_of(Ix2(coefficients.len(), 8), flat)?.into_pyarray(py);
        Ok((coefficients, facts_of(&self.dynamics).to_pyarray(py)))
    }

    fn stages<'py>(&self, py: Python<'py>, substeps: u32) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let most = MAX_SUBSTEPS * MAX_SUBSTEP_FACTOR;
        if !(1..=most).contains(&substeps) {
            return Err(SettingError::new_err(format!("`substeps` is {substeps}, give 1 to {most}")));
        }
        let shape = Ix3(self.dynamics.n_time() - 1, 2 * substeps as usize + 1, 2);
        let flat = self
            .dynamics
            .stages(substeps)
            .into_iter()
            .flat_map(|motion| [motion.displacement, motion.velocity])
            .collect();
        Ok(array_of(shape, flat)?.into_pyarray(py))
    }
}
