//! Dampers printed as C.

use mrwork_dynamics::record::{Precision, damper_text as text, elementary_functions as elementary};
use mrwork_dynamics::sampled::{Samples, straight_forces as straight};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::contiguous;
use crate::damper::{named, parsed_laws};

/// Statements of the functions of a damper by name, see `mrwork_dynamics::record::DamperText`.
#[pyfunction]
#[pyo3(signature = (model, coefficients, step, laws=None, lagged=false, single=false))]
pub fn damper_text<'py>(
    py: Python<'py>,
    model: &str,
    coefficients: Vec<String>,
    step: f64,
    laws: Option<Vec<String>>,
    lagged: bool,
    single: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let spec = named(model)?.spec();
    let laws = parsed_laws(spec, laws, lagged)?;
    let precision = if single { Precision::Single } else { Precision::Double };
    let functions = PyDict::new(py);
    if let Some(text) = text(spec.name, &coefficients, &laws, step, precision) {
        functions.set_item("prepare", text.prepare)?;
        functions.set_item("parameters", text.parameters)?;
        functions.set_item("force", text.force)?;
        functions.set_item("rate", text.rate)?;
        functions.set_item("substep", text.substep)?;
    }
    Ok(functions)
}

/// exp, ln, x^n and tanh in C.
#[pyfunction]
pub fn elementary_functions() -> String {
    elementary()
}

/// Forces at samples with straight lines between the motions at them, shape (`n_time`,).
#[pyfunction]
#[pyo3(signature = (model, theta, displacement, velocity, command, dt, substeps, laws=None, lagged=false))]
#[allow(clippy::too_many_arguments)] // a boundary function takes plain values, by keyword from Python
pub fn straight_forces<'py>(
    py: Python<'py>,
    model: &str,
    theta: PyReadonlyArray1<'py, f64>,
    displacement: PyReadonlyArray1<'py, f64>,
    velocity: PyReadonlyArray1<'py, f64>,
    command: PyReadonlyArray1<'py, f64>,
    dt: f64,
    substeps: u32,
    laws: Option<Vec<String>>,
    lagged: bool,
) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
    let spec = named(model)?.spec();
    let laws = parsed_laws(spec, laws, lagged)?;
    let samples = Samples {
        displacement: contiguous("displacement", &displacement)?,
        velocity: contiguous("velocity", &velocity)?,
        command: contiguous("command", &command)?,
    };
    let theta = contiguous("theta", &theta)?;
    Ok(straight(spec.name, theta, &laws, samples, dt, substeps).map(|force| force.into_pyarray(py)))
}
