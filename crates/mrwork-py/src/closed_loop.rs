//! Buildings in closed loop, and the control laws, in Python.

use mrwork_dynamics::building::{Building as Dynamics, Element, Matrices};
use mrwork_dynamics::closed_loop::{
    self, Batch, Channel, Fault, HISTORY_SIGNALS, Hardware, Observer, OutsideLaw, Quantity, RUN_QUANTITIES,
    Run, Sensor, n_samples,
};
use mrwork_dynamics::control::{CurveModel, Law, LawSpec, Mounting, Shape};
use mrwork_dynamics::damper::find_device;
use mrwork_dynamics::ground_motion::GroundMotion;
use mrwork_dynamics::settings::Settings;
use numpy::ndarray::Ix2;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyLookupError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Axis, array_of, contiguous, shaped, zeros};
use crate::asked_law::AskedLaw;
use crate::damper::parsed_laws;
use crate::enter::{chosen_instruction_set, interruptible, value_error};

/// Matrices of a building, with a row for each of its devices.
#[pyclass(frozen, module = "mrwork._rust")]
pub struct Building {
    dynamics: Dynamics,
}

#[pymethods]
impl Building {
    #[new]
    #[allow(clippy::too_many_arguments)] // the matrices of one equation
    fn new(
        mass: PyReadonlyArray2<'_, f64>,
        damping: PyReadonlyArray2<'_, f64>,
        stiffness: PyReadonlyArray2<'_, f64>,
        influence: PyReadonlyArray1<'_, f64>,
        floors: PyReadonlyArray2<'_, f64>,
        storeys: PyReadonlyArray2<'_, f64>,
        devices: PyReadonlyArray2<'_, f64>,
        elements: PyReadonlyArray2<'_, f64>,
        element_parameters: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let columns = ("coordinates", Some(influence.len()));
        let square = [columns; 2];
        let numbers = [("elements", None), ("numbers of an element", Some(6))];
        let (numbers, _) = shaped("element_parameters", &element_parameters, &numbers)?.as_chunks::<6>();
        let element_parameters: Vec<Element> = numbers
            .iter()
            .map(|&[stiffness, damping, head_loss, yield_force, slope, sharpness]| Element {
                stiffness,
                damping,
                head_loss,
                yield_force,
                slope,
                sharpness,
            })
            .collect();
        let matrices = Matrices {
            mass: shaped("mass", &mass, &square)?,
            damping: shaped("damping", &damping, &square)?,
            stiffness: shaped("stiffness", &stiffness, &square)?,
            influence: contiguous("influence", &influence)?,
            floors: shaped("floors", &floors, &[("floors", None), columns])?,
            storeys: shaped("storeys", &storeys, &[("storeys", None), columns])?,
            devices: shaped("devices", &devices, &[("devices", None), columns])?,
            elements: shaped(
                "elements",
                &elements,
                &[("elements", Some(element_parameters.len())), columns],
            )?,
            element_parameters: &element_parameters,
        };
        Ok(Self { dynamics: Dynamics::new(&matrices).map_err(value_error)? })
    }

    /// Quantities of the summary of a run, in order, each with its number of columns.
    #[getter]
    fn summary_layout(&self) -> Vec<(&'static str, usize)> {
        columns_of(RUN_QUANTITIES, &self.dynamics)
    }

    /// Signals of a history, in order, each with its number of columns.
    #[getter]
    fn history_layout(&self) -> Vec<(&'static str, usize)> {
        columns_of(HISTORY_SIGNALS, &self.dynamics)
    }
}

fn columns_of(quantities: &[Quantity], building: &Dynamics) -> Vec<(&'static str, usize)> {
    quantities.iter().map(|quantity| (quantity.name, quantity.axis.length(building))).collect()
}

type Layout = Vec<(&'static str, &'static str, &'static str, &'static str)>;

fn layout_of(quantities: &[Quantity]) -> Layout {
    quantities
        .iter()
        .map(|&Quantity { name, axis, unit, description }| (name, axis.name(), unit, description))
        .collect()
}

/// Quantities of the summary of a run, in order: name, axis, unit, description.
#[pyfunction]
pub fn run_quantities() -> Layout {
    layout_of(RUN_QUANTITIES)
}

/// Signals of a history, in order: name, axis, unit, description.
#[pyfunction]
pub fn history_signals() -> Layout {
    layout_of(HISTORY_SIGNALS)
}

/// Every control law, as plain dictionaries in registry order.
#[pyfunction]
pub fn control_laws(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    Law::ALL.iter().map(|law| law_dict(py, law.spec())).collect()
}

fn law_dict<'py>(py: Python<'py>, spec: &LawSpec) -> PyResult<Bound<'py, PyDict>> {
    let entry = PyDict::new(py);
    entry.set_item("name", spec.name)?;
    entry.set_item("title", spec.title)?;
    entry.set_item("equation", spec.equation)?;
    entry.set_item("description", spec.description)?;
    entry.set_item("source", spec.source)?;
    entry.set_item("tables", spec.tables.to_vec())?;
    entry.set_item("needs_curve", spec.needs_curve)?;
    entry.set_item("commands_force", spec.commands_force)?;
    let gains = spec.gains.iter().map(|gain| {
        let entry = PyDict::new(py);
        entry.set_item("name", gain.name)?;
        entry.set_item("unit", gain.unit)?;
        entry.set_item("shape", gain.shape.name())?;
        entry.set_item("numbers", if let Shape::Numbers(count) = gain.shape { count } else { 1 })?;
        entry.set_item("description", gain.description)?;
        Ok(entry)
    });
    entry.set_item("gains", gains.collect::<PyResult<Vec<_>>>()?)?;
    Ok(entry)
}

type Laws = (Option<Vec<String>>, bool);
type FaultArguments = (String, usize, usize, usize, Option<f64>);
type Matrix<'py> = PyReadonlyArray2<'py, f64>;
type ObserverArguments<'py> =
    (Vec<usize>, Vec<usize>, Matrix<'py>, Matrix<'py>, Matrix<'py>, Matrix<'py>, Matrix<'py>);
type Responses<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<u32>>,
    Option<Vec<Bound<'py, PyArray2<f64>>>>,
);

/// Runs of a building in closed loop: summaries, shape (`n_runs`, width), outcomes, integration steps per sample, and, if
/// requested, histories, one array per run.
///
/// `theta` has shape (draws, devices, columns); `runs` has a row (candidate, motion, draw) for each run; `sensors` a row
/// (noise, resolution) for acceleration, deformation and force; `places` (count, differential) for each device.
/// `outside` is a law in Python that commands instead of `law`, see [`AskedLaw`].
#[pyfunction]
#[pyo3(signature = (
    building, model, laws, theta, places, ranges, law, gains, tables, curve, motions, runs, streams, sample_time,
    steps, delay_steps, command_rate, sensors, faults, observer, histories=false, step_factor=1, threads=0,
    outside=None
))]
#[allow(clippy::too_many_arguments)] // a boundary function takes plain values, by keyword from Python
pub fn respond<'py>(
    py: Python<'py>,
    building: &Building,
    model: &str,
    laws: Laws,
    theta: PyReadonlyArray3<'py, f64>,
    places: Vec<(f64, bool)>,
    ranges: Vec<[f64; 2]>,
    law: &str,
    gains: PyReadonlyArray2<'py, f64>,
    tables: Vec<PyReadonlyArray1<'py, f64>>,
    curve: Option<(Laws, PyReadonlyArray1<'py, f64>)>,
    motions: Vec<(f64, PyReadonlyArray1<'py, f64>)>,
    runs: PyReadonlyArray2<'py, u32>,
    streams: PyReadonlyArray1<'py, u64>,
    sample_time: f64,
    steps: u32,
    delay_steps: usize,
    command_rate: f64,
    sensors: [[f64; 2]; 3],
    faults: Vec<FaultArguments>,
    observer: Option<ObserverArguments<'py>>,
    histories: bool,
    step_factor: u32,
    threads: usize,
    outside: Option<Py<PyAny>>,
) -> PyResult<Responses<'py>> {
    let damper = find_device(model)
        .ok_or_else(|| PyLookupError::new_err(format!("no damper model is called `{model}`")))?;
    let laws = parsed_laws(damper.spec(), laws.0, laws.1)?;
    let law =
        Law::find(law).ok_or_else(|| PyLookupError::new_err(format!("no control law is called `{law}`")))?;
    let curve = match &curve {
        Some((laws, theta)) => {
            let spec = find_device("static_hysteretic")
                .ok_or_else(|| PyLookupError::new_err("no static_hysteretic"))?
                .spec();
            Some((parsed_laws(spec, laws.0.clone(), laws.1)?, theta))
        }
        None => None,
    };
    let curve = curve
        .as_ref()
        .map(|(laws, theta)| {
            let theta = shaped("curve", theta, &[("columns", Some(laws.n_columns()))])?;
            CurveModel::new(laws, theta).map_err(value_error)
        })
        .transpose()?;
    let motions = motions
        .iter()
        .map(|(dt, samples)| {
            GroundMotion::new(*dt, contiguous("acceleration", samples)?).map_err(value_error)
        })
        .collect::<PyResult<Vec<_>>>()?;
    let mountings: Vec<Mounting> =
        places.into_iter().map(|(count, differential)| Mounting { count, differential }).collect();
    let tables =
        tables.iter().map(|table| Ok(contiguous("tables", table)?.to_vec())).collect::<PyResult<Vec<_>>>()?;
    let [acceleration, deformation, force] = sensors.map(|[noise, resolution]| Sensor { noise, resolution });
    let faults = faults.into_iter().map(fault).collect::<PyResult<_>>()?;
    let hardware =
        Hardware { sample_time, steps, delay_steps, command_rate, acceleration, deformation, force, faults };
    let n_states = 2 * building.dynamics.n_coordinates();
    let n_devices = mountings.len();
    let observer = observer.map(|arguments| observer_of(arguments, n_states, n_devices)).transpose()?;
    let (rows, _) =
        shaped("runs", &runs, &[("runs", None), ("candidate, motion and draw", Some(3))])?.as_chunks::<3>();
    let runs: Vec<Run> = rows
        .iter()
        .zip(shaped("streams", &streams, &[("runs", Some(rows.len()))])?)
        .map(|(&[candidate, motion, draw], &stream)| Run { candidate, motion, draw, stream })
        .collect();
    let devices = ("devices", Some(n_devices));
    let columns = ("columns", Some(laws.n_columns()));
    let n_gains = law.spec().n_gains(n_devices, n_states);
    let outside = outside.map(|law| AskedLaw::new(law, building.dynamics.n_coordinates(), n_devices));
    let batch = Batch {
        building: &building.dynamics,
        laws: &laws,
        theta: shaped("theta", &theta, &[("draws", None), devices, columns])?,
        mountings: &mountings,
        ranges: &ranges,
        law,
        outside: outside.as_ref().map(|law| law as &dyn OutsideLaw),
        gains: shaped("gains", &gains, &[("candidates", None), ("gains", Some(n_gains))])?,
        tables: &tables,
        curve,
        motions: &motions,
        runs: &runs,
        hardware: &hardware,
        observer: observer.as_ref(),
    };
    batch.check().map_err(value_error)?;
    let width = closed_loop::width(RUN_QUANTITIES, &building.dynamics);
    let history_width = closed_loop::width(HISTORY_SIGNALS, &building.dynamics);
    let mut summary = zeros(&[runs.len(), width])?;
    let lengths: Vec<usize> =
        runs.iter().map(|run| n_samples(&motions[run.motion as usize], &hardware)).collect();
    let mut rows: Option<Vec<Vec<f64>>> = histories
        .then(|| lengths.iter().map(|&samples| zeros(&[samples, history_width])).collect())
        .transpose()?;
    let instruction_set = chosen_instruction_set()?;
    // A law in Python is asked by the calling thread only.
    let threads = if outside.is_some() { 1 } else { threads };
    let results = interruptible(py, |stop| {
        let stop = &|| stop() || outside.as_ref().is_some_and(AskedLaw::failed);
        let settings = Settings { step_factor, threads, instruction_set, stop };
        closed_loop::respond(damper, &batch, &mut summary, rows.as_deref_mut(), settings)
    });
    if let Some(error) = outside.as_ref().and_then(AskedLaw::error) {
        return Err(error);
    }
    let results = results?;
    let outcome: Vec<u8> = results.iter().map(|result| result.outcome as u8).collect();
    let steps: Vec<u32> = results.iter().map(|result| result.steps).collect();
    let histories = rows
        .map(|rows| {
            rows.into_iter()
                .zip(lengths)
                .map(|(row, samples)| Ok(array_of(Ix2(samples, history_width), row)?.into_pyarray(py)))
                .collect::<PyResult<Vec<_>>>()
        })
        .transpose()?;
    let summary = array_of(Ix2(runs.len(), width), summary)?.into_pyarray(py);
    Ok((summary, outcome.into_pyarray(py), steps.into_pyarray(py), histories))
}

fn fault((kind, index, start, end, value): FaultArguments) -> PyResult<Fault> {
    let channel = match kind.as_str() {
        "acceleration" => Channel::Acceleration(index),
        "deformation" => Channel::Deformation(index),
        "force" => Channel::Force(index),
        "command" => Channel::Command(index),
        other => {
            return Err(PyValueError::new_err(format!(
                "a fault is in acceleration, deformation, force or command, not in `{other}`"
            )));
        }
    };
    Ok(Fault { channel, start, end, value })
}

fn observer_of(arguments: ObserverArguments<'_>, n_states: usize, n_devices: usize) -> PyResult<Observer> {
    let (accelerations, deformations, transition, input, gain, output, direct) = arguments;
    let states = ("states", Some(n_states));
    let devices = ("devices", Some(n_devices));
    let measurements = ("measurements", Some(accelerations.len() + deformations.len()));
    let flat = |name: &str, matrix: &Matrix<'_>, axes: [Axis; 2]| {
        Ok::<_, PyErr>(shaped(name, matrix, &axes)?.to_vec())
    };
    Ok(Observer {
        transition: flat("transition", &transition, [states, states])?,
        input: flat("input", &input, [states, devices])?,
        gain: flat("gain", &gain, [states, measurements])?,
        output: flat("output", &output, [measurements, states])?,
        direct: flat("direct", &direct, [measurements, devices])?,
        accelerations,
        deformations,
    })
}
