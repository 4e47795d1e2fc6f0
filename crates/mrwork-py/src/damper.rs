//! Damper models in Python: specs, batches, single evaluations.

use mrwork_dynamics::any_damper::Damper;
use mrwork_dynamics::current_law::{CurrentLaw, CurrentLaws};
use mrwork_dynamics::damper::{DamperSpec, Motion, REGISTRY, find};
use mrwork_dynamics::error::DynamicsError;
use mrwork_dynamics::lag::Lag;
use mrwork_dynamics::misfit::Target;
use mrwork_dynamics::parameters::ParamSpec;
use mrwork_dynamics::sensitivity;
use mrwork_dynamics::settings::Settings;
use mrwork_dynamics::simulate::{self, CandidateResult};
use numpy::ndarray::{Ix2, Ix3};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyLookupError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array_of, contiguous, zeros};
use crate::enter::{SettingError, chosen_instruction_set, interruptible, refused};
use crate::loading::LoadingHistory;

type Floats<'py> = Bound<'py, PyArray1<f64>>;
type Outcomes<'py> = Bound<'py, PyArray1<u8>>;
type Substeps<'py> = Bound<'py, PyArray1<u32>>;

/// Every registered damper model, as plain dictionaries in registry order.
#[pyfunction]
pub fn damper_specs(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    REGISTRY.iter().map(|damper| damper_dict(py, damper.spec())).collect()
}

fn damper_dict<'py>(py: Python<'py>, spec: &DamperSpec) -> PyResult<Bound<'py, PyDict>> {
    let entry = PyDict::new(py);
    entry.set_item("name", spec.name)?;
    entry.set_item("title", spec.title)?;
    entry.set_item("equation", spec.equation)?;
    entry.set_item("description", spec.description)?;
    entry.set_item("source", spec.source)?;
    entry.set_item("nominal_source", spec.nominal_source)?;
    entry.set_item("n_states", spec.n_states)?;
    entry.set_item("odd", spec.odd)?;
    entry.set_item("relaxes", spec.relaxes)?;
    entry.set_item("spring", spec.spring)?;
    let parameters = spec.parameters.iter().map(|parameter| parameter_dict(py, parameter));
    entry.set_item("parameters", parameters.collect::<PyResult<Vec<_>>>()?)?;
    Ok(entry)
}

fn parameter_dict<'py>(py: Python<'py>, parameter: &ParamSpec) -> PyResult<Bound<'py, PyDict>> {
    let entry = PyDict::new(py);
    entry.set_item("name", parameter.name)?;
    entry.set_item("unit", parameter.unit)?;
    entry.set_item("scale", parameter.scale.name())?;
    entry.set_item("lower", parameter.lower)?;
    entry.set_item("upper", parameter.upper)?;
    entry.set_item("nominal", parameter.nominal)?;
    entry.set_item("description", parameter.description)?;
    Ok(entry)
}

/// Sums of squared residuals of a batch from sample `first` on, with the outcome, sub-steps and simulated steps of each
/// candidate; a candidate that reaches its limit is abandoned.
#[pyfunction]
#[pyo3(signature = (
    model, theta, loading, force, first=0, laws=None, rates=0, substep_factor=1, threads=0, limits=None
))]
#[allow(clippy::too_many_arguments)] // a boundary function takes plain values, by keyword from Python
pub fn misfits<'py>(
    py: Python<'py>,
    model: &str,
    theta: PyReadonlyArray2<'py, f64>,
    loading: &LoadingHistory,
    force: PyReadonlyArray1<'py, f64>,
    first: usize,
    laws: Option<Vec<String>>,
    rates: usize,
    substep_factor: u32,
    threads: usize,
    limits: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<(Floats<'py>, Outcomes<'py>, Substeps<'py>, Bound<'py, PyArray1<u64>>)> {
    let (damper, laws, theta) = batch(model, laws, rates, &theta)?;
    let target = Target { force: contiguous("force", &force)?, first };
    let limits = limits.as_ref().map(|limits| contiguous("limits", limits)).transpose()?;
    let instruction_set = chosen_instruction_set()?;
    let rows = interruptible(py, |stop| {
        let settings = Settings { step_factor: substep_factor, threads, instruction_set, stop };
        simulate::misfits(damper, &laws, theta, &loading.dynamics, target, limits, settings)
    })?;
    let squared_errors: Vec<f64> = rows.iter().map(|row| row.squared_error).collect();
    let steps: Vec<u64> = rows.iter().map(|row| row.steps).collect();
    let (outcome, substeps) = columns(py, &rows);
    Ok((squared_errors.into_pyarray(py), outcome, substeps, steps.into_pyarray(py)))
}

/// Stiffness of each candidate, shape (`n_batch`,), as a share of the largest that is simulated at the step of this loading.
#[pyfunction]
#[pyo3(signature = (model, theta, loading, laws=None, rates=0))]
pub fn stiffness_shares<'py>(
    py: Python<'py>,
    model: &str,
    theta: PyReadonlyArray2<'py, f64>,
    loading: &LoadingHistory,
    laws: Option<Vec<String>>,
    rates: usize,
) -> PyResult<Floats<'py>> {
    let (damper, laws, theta) = batch(model, laws, rates, &theta)?;
    let instruction_set = chosen_instruction_set()?;
    let shares = interruptible(py, |stop| {
        let settings = Settings { step_factor: 1, threads: 0, instruction_set, stop };
        simulate::stiffness_shares(damper, &laws, theta, &loading.dynamics, settings)
    })?;
    Ok(shares.into_pyarray(py))
}

/// Force histories of a batch, shape (`n_batch`, `n_time`); rows that did not finish are infinite.
#[pyfunction]
#[pyo3(signature = (model, theta, loading, laws=None, rates=0, substep_factor=1, threads=0))]
#[allow(clippy::too_many_arguments)] // a boundary function takes plain values, by keyword from Python
pub fn force_histories<'py>(
    py: Python<'py>,
    model: &str,
    theta: PyReadonlyArray2<'py, f64>,
    loading: &LoadingHistory,
    laws: Option<Vec<String>>,
    rates: usize,
    substep_factor: u32,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Outcomes<'py>, Substeps<'py>)> {
    let n_batch = theta.shape()[0];
    let (damper, laws, theta) = batch(model, laws, rates, &theta)?;
    let instruction_set = chosen_instruction_set()?;
    let mut force = zeros(&[n_batch, loading.dynamics.n_time()])?;
    let rows = interruptible(py, |stop| {
        let settings = Settings { step_factor: substep_factor, threads, instruction_set, stop };
        simulate::force_histories(damper, &laws, theta, &loading.dynamics, &mut force, settings)
    })?;
    let force = array_of(Ix2(n_batch, loading.dynamics.n_time()), force)?;
    let (outcome, substeps) = columns(py, &rows);
    Ok((force.into_pyarray(py), outcome, substeps))
}

/// Force histories of a batch, shape (`n_batch`, `n_time`), and their derivatives with respect to columns of `theta` (all
/// by default), shape (`n_batch`, `n_asked`, `n_time`); rows that did not finish are infinite.
#[pyfunction]
#[pyo3(signature = (
    model, theta, loading, columns=None, laws=None, rates=0, substep_factor=1, threads=0
))]
#[allow(clippy::too_many_arguments)] // a boundary function takes plain values, by keyword from Python
#[allow(clippy::type_complexity)] // the results of one call
pub fn sensitivities<'py>(
    py: Python<'py>,
    model: &str,
    theta: PyReadonlyArray2<'py, f64>,
    loading: &LoadingHistory,
    columns: Option<Vec<usize>>,
    laws: Option<Vec<String>>,
    rates: usize,
    substep_factor: u32,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>, Outcomes<'py>, Substeps<'py>)> {
    let (n_batch, n_time) = (theta.shape()[0], loading.dynamics.n_time());
    let (damper, laws, theta) = batch(model, laws, rates, &theta)?;
    let asked = columns.unwrap_or_else(|| (0..laws.n_columns()).collect());
    let instruction_set = chosen_instruction_set()?;
    let mut force = zeros(&[n_batch, n_time])?;
    let mut jacobian = zeros(&[n_batch, asked.len(), n_time])?;
    let rows = interruptible(py, |stop| {
        let settings = Settings { step_factor: substep_factor, threads, instruction_set, stop };
        let (force, jacobian) = (&mut force, &mut jacobian);
        sensitivity::sensitivities(damper, &laws, theta, &asked, &loading.dynamics, force, jacobian, settings)
    })?;
    let force = array_of(Ix2(n_batch, n_time), force)?;
    let jacobian = array_of(Ix3(n_batch, asked.len(), n_time), jacobian)?;
    let (outcome, substeps) = self::columns(py, &rows);
    Ok((force.into_pyarray(py), jacobian.into_pyarray(py), outcome, substeps))
}

/// Time derivative of the states at one point, shape (`n_states`,).
#[pyfunction]
pub fn rate<'py>(
    py: Python<'py>,
    model: &str,
    theta: PyReadonlyArray1<'py, f64>,
    state: PyReadonlyArray1<'py, f64>,
    displacement: f64,
    velocity: f64,
) -> PyResult<Floats<'py>> {
    let damper = named(model)?;
    let (theta, state) = point(damper, &theta, &state)?;
    Ok(damper.rate(theta, state, Motion { displacement, velocity }).into_pyarray(py))
}

/// Force at one point [N].
#[pyfunction]
pub fn force(
    model: &str,
    theta: PyReadonlyArray1<'_, f64>,
    state: PyReadonlyArray1<'_, f64>,
    displacement: f64,
    velocity: f64,
) -> PyResult<f64> {
    let damper = named(model)?;
    let (theta, state) = point(damper, &theta, &state)?;
    Ok(damper.force(theta, state, Motion { displacement, velocity }))
}

/// The registered model of that name.
pub fn named(model: &str) -> PyResult<&'static dyn Damper> {
    find(model).ok_or_else(|| {
        let known: Vec<&str> = REGISTRY.iter().map(|damper| damper.spec().name).collect();
        PyLookupError::new_err(format!("no damper model is called {model:?}; there are {}", known.join(", ")))
    })
}

/// The model, its laws and its parameters, one column per coefficient.
fn batch<'a>(
    model: &str,
    laws: Option<Vec<String>>,
    rates: usize,
    theta: &'a PyReadonlyArray2<'_, f64>,
) -> PyResult<(&'static dyn Damper, CurrentLaws, &'a [f64])> {
    let damper = named(model)?;
    let spec = damper.spec();
    let laws = parsed_laws(spec, laws, rates)?;
    let (found, expected) = (theta.shape()[1], laws.n_columns());
    if found != expected {
        return Err(refused(DynamicsError::ParameterCount { model: spec.name, found, expected }));
    }
    Ok((damper, laws, contiguous("theta", theta)?))
}

/// The current laws of those names, one per parameter, and a lag of so many rates; all constant for `None`.
pub fn parsed_laws(
    spec: &'static DamperSpec,
    names: Option<Vec<String>>,
    rates: usize,
) -> PyResult<CurrentLaws> {
    match names {
        Some(names) => {
            let laws: Result<_, _> = names.iter().map(|name| CurrentLaw::of_name(name)).collect();
            let lag = Lag::with_rates(rates).ok_or_else(|| refused(DynamicsError::LagRates(rates)))?;
            CurrentLaws::new(spec, laws.map_err(refused)?, lag).map_err(refused)
        }
        None => Ok(CurrentLaws::constant(spec)),
    }
}

/// Every current law with a name of its own: name, number of coefficients, and degree if it is a polynomial.
#[pyfunction]
pub fn current_laws() -> Vec<(&'static str, usize, Option<usize>)> {
    CurrentLaw::NAMED.map(|law| (law.name(), law.n_coefficients(), law.degree())).to_vec()
}

fn point<'a>(
    damper: &dyn Damper,
    theta: &'a PyReadonlyArray1<'_, f64>,
    state: &'a PyReadonlyArray1<'_, f64>,
) -> PyResult<(&'a [f64], &'a [f64])> {
    let theta = contiguous("theta", theta)?;
    let state = contiguous("state", state)?;
    check_count(damper, theta.len())?;
    let n_states = damper.n_states();
    if state.len() != n_states {
        return Err(SettingError::new_err(format!(
            "`state` has {} entries, the model has {n_states}",
            state.len()
        )));
    }
    Ok((theta, state))
}

/// Refuses a parameter vector of the wrong length.
pub fn check_count(damper: &dyn Damper, found: usize) -> PyResult<()> {
    let spec = damper.spec();
    let expected = spec.parameters.len();
    if found == expected {
        return Ok(());
    }
    Err(refused(DynamicsError::ParameterCount { model: spec.name, found, expected }))
}

fn columns<'py>(py: Python<'py>, rows: &[CandidateResult]) -> (Outcomes<'py>, Substeps<'py>) {
    let outcome: Vec<u8> = rows.iter().map(|row| row.outcome as u8).collect();
    let substeps: Vec<u32> = rows.iter().map(|row| row.substeps).collect();
    (outcome.into_pyarray(py), substeps.into_pyarray(py))
}
