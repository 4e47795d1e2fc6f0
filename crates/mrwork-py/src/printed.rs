//! Dampers and controllers printed as C.

use mrwork_dynamics::closed_loop::{self, Batch, Run};
use mrwork_dynamics::control::RolloutText;
use mrwork_dynamics::current_law::CurrentLaws;
use mrwork_dynamics::damper::DamperSpec;
use mrwork_dynamics::error::DynamicsError;
use mrwork_dynamics::ground_motion::GroundMotion;
use mrwork_dynamics::integrate::{MAX_SUBSTEP_FACTOR, MAX_SUBSTEPS};
use mrwork_dynamics::record::{Precision, damper_text as text, elementary_functions as elementary};
use mrwork_dynamics::sampled::{Division, Samples, straight_forces as straight};
use numpy::ndarray::Ix2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};

use crate::arrays::{array_of, contiguous, shaped};
use crate::closed_loop::{LoopHardware, Observer, groups_of};
use crate::control::Controller;
use crate::coupled::{Building, Dampers};
use crate::damper::{named, parsed_laws};
use crate::enter::{SettingError, refused};
use crate::own::LawTape;

/// Statements of the functions of a damper by name, see `mrwork_dynamics::record::DamperText`.
#[pyfunction]
#[pyo3(signature = (model, coefficients, steps, laws=None, rates=0, single=false))]
pub fn damper_text<'py>(
    py: Python<'py>,
    model: &str,
    coefficients: Vec<String>,
    steps: Vec<f64>,
    laws: Option<Vec<String>>,
    rates: usize,
    single: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let spec = named(model)?.spec();
    let laws = parsed_laws(spec, laws, rates)?;
    check_columns(spec, &laws, coefficients.len())?;
    if let Some(step) = steps.iter().find(|step| !(step.is_finite() && **step > 0.0)) {
        return Err(SettingError::new_err(format!("one of `steps` is {step}, give positive numbers")));
    }
    let precision = if single { Precision::Single } else { Precision::Double };
    let functions = PyDict::new(py);
    if let Some(text) = text(spec.name, &coefficients, &laws, &steps, precision) {
        functions.set_item("prepare", text.prepare)?;
        functions.set_item("parameters", text.parameters)?;
        functions.set_item("force", text.force)?;
        functions.set_item("rate", text.rate)?;
        functions.set_item("substep", text.substep)?;
        functions.set_item("n_prepared", text.n_prepared)?;
        functions.set_item("calls", text.calls)?;
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
#[pyo3(signature = (model, theta, displacement, velocity, command, dt, substeps, laws=None, rates=0, speeds=Vec::new(), fading=0.0))]
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
    rates: usize,
    speeds: Vec<f64>,
    fading: f64,
) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
    let spec = named(model)?.spec();
    let laws = parsed_laws(spec, laws, rates)?;
    let theta = contiguous("theta", &theta)?;
    check_columns(spec, &laws, theta.len())?;
    let most = MAX_SUBSTEPS * MAX_SUBSTEP_FACTOR;
    if !(1..=most).contains(&substeps) {
        return Err(SettingError::new_err(format!("`substeps` is {substeps}, give 1 to {most}")));
    }
    // As many halves of a sub-step as MAX_SUBSTEP_FACTOR allows.
    let halvings = MAX_SUBSTEP_FACTOR.ilog2() as usize;
    if speeds.len() > halvings + 1 {
        return Err(SettingError::new_err(format!(
            "`speeds` has {} numbers, give at most {}",
            speeds.len(),
            halvings + 1
        )));
    }
    let division = Division { speeds: &speeds, fading };
    let axes = [("samples", Some(displacement.as_array().len()))];
    let samples = Samples {
        displacement: contiguous("displacement", &displacement)?,
        velocity: shaped("velocity", &velocity, &axes)?,
        command: shaped("command", &command, &axes)?,
    };
    Ok(straight(spec.name, theta, &laws, samples, dt, substeps, division).map(|force| force.into_pyarray(py)))
}

/// A loop without a motion, of which the controller is printed.
#[derive(FromPyObject)]
pub struct PrintedLoop {
    building: Py<Building>,
    dampers: Vec<Py<Dampers>>,
    controller: Py<Controller>,
    hardware: LoopHardware,
    observer: Option<Py<Observer>>,
    n_commanded: usize,
    own: Option<Py<LawTape>>,
}

impl PrintedLoop {
    /// What `work` makes of it as a batch of one run.
    fn on_batch<T>(self, work: impl FnOnce(&Batch<'_>) -> T) -> PyResult<T> {
        let Self { building, dampers, controller, hardware, observer, n_commanded, own } = self;
        let (building, controller) = (building.get(), controller.get());
        let hardware = hardware.dynamics()?;
        let (groups, ranges) = groups_of(&dampers);
        let still = [GroundMotion::new(hardware.sample_time, &[0.0; 8]).map_err(refused)?];
        let run = Run { candidate: 0, motion: 0, draw: 0, springs: 0, delay_steps: 0, stream: 0 };
        let batch = Batch {
            building: &building.dynamics,
            springs: &building.springs,
            dampers: &groups,
            ranges: &ranges,
            n_commanded,
            law: controller.law,
            own: own.as_ref().map(|own| &own.get().law),
            outside: None,
            gains: controller.gains(n_commanded, 2 * building.dynamics.n_coordinates())?,
            tables: &controller.tables,
            shaping: &controller.shaping,
            curve: controller.curve()?,
            model: controller.model(),
            motions: &still,
            runs: &[run],
            hardware: &hardware,
            observer: observer.as_ref().map(|observer| &observer.get().dynamics),
        };
        batch.check().map_err(refused)?;
        Ok(work(&batch))
    }
}

/// Statements of the commands of a controller, see `mrwork_dynamics::closed_loop::LawText`.
#[pyfunction]
#[pyo3(signature = (looped, single=false))]
pub fn law_text(py: Python<'_>, looped: PrintedLoop, single: bool) -> PyResult<Bound<'_, PyDict>> {
    let precision = if single { Precision::Single } else { Precision::Double };
    let text = looped.on_batch(|batch| closed_loop::law_text(batch, precision))?;
    let entry = PyDict::new(py);
    entry.set_item("command", text.command)?;
    entry.set_item("reads", text.reads)?;
    entry.set_item("kept", text.kept)?;
    entry.set_item("furthest", text.furthest)?;
    entry.set_item("tables", text.tables)?;
    entry.set_item("calls", text.calls)?;
    entry.set_item("rollout", text.rollout.map(|rollout| rollout_entry(py, rollout)).transpose()?)?;
    Ok(entry)
}

/// The functions of a rollout, see `mrwork_dynamics::control::RolloutText`.
fn rollout_entry(py: Python<'_>, text: RolloutText) -> PyResult<Bound<'_, PyDict>> {
    let entry = PyDict::new(py);
    entry.set_item("read", text.read)?;
    entry.set_item("settle", text.settle)?;
    entry.set_item("drives", text.drives)?;
    entry.set_item("follow", text.follow)?;
    entry.set_item("compare", text.compare)?;
    entry.set_item("moves", text.moves)?;
    entry.set_item("price", text.price)?;
    entry.set_item("fixed", text.fixed)?;
    entry.set_item("ranges", text.ranges)?;
    entry.set_item("counts", text.counts.into_py_dict(py)?)?;
    entry.set_item("numbers", text.numbers.into_py_dict(py)?)?;
    Ok(entry)
}

/// Names and numbers of entries of what a controller is given at a sample, in order.
#[pyfunction]
pub fn law_readings(looped: PrintedLoop) -> PyResult<Vec<(&'static str, usize)>> {
    looped.on_batch(closed_loop::readings_of)
}

/// Commands of a controller, shape (samples, devices), for readings, shape (samples, readings).
#[pyfunction]
pub fn law_commands<'py>(
    py: Python<'py>,
    looped: PrintedLoop,
    readings: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let samples = readings.as_array().nrows();
    let commands = looped.on_batch(|batch| {
        let width = closed_loop::readings_of(batch).iter().map(|signal| signal.1).sum();
        let axes = [("samples", None), ("readings", Some(width))];
        let n_devices = batch.ranges.len();
        let commands = closed_loop::commands_of(batch, shaped("readings", &readings, &axes)?);
        array_of(Ix2(samples, n_devices), commands)
    })?;
    Ok(commands?.into_pyarray(py))
}

/// Refuses another number of coefficients than the laws of a model have.
fn check_columns(spec: &'static DamperSpec, laws: &CurrentLaws, found: usize) -> PyResult<()> {
    let expected = laws.n_columns();
    if found == expected {
        return Ok(());
    }
    Err(refused(DynamicsError::ParameterCount { model: spec.name, found, expected }))
}
