//! Buildings under ground motions, and the control laws, as Python sees them.

use mrwork_dynamics::building::{Building as Dynamics, Matrices};
use mrwork_dynamics::closed_loop::{
    self, Batch, Channel, Fault, Hardware, Observer, Run, Sensor, Settings, find_device, history_layout,
    n_samples, summary_layout,
};
use mrwork_dynamics::control::{CurveModel, Law, LawSpec, Place};
use mrwork_dynamics::ground_motion::GroundMotion;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::{PyLookupError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::damper::parsed_laws;
use crate::enter::{chosen_instruction_set, interruptible, value_error};
use crate::loading::contiguous;

/// Matrices of a building with the places of its devices.
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
    ) -> PyResult<Self> {
        let matrices = Matrices {
            mass: contiguous("mass", &mass)?,
            damping: contiguous("damping", &damping)?,
            stiffness: contiguous("stiffness", &stiffness)?,
            influence: contiguous("influence", &influence)?,
            floors: contiguous("floors", &floors)?,
            storeys: contiguous("storeys", &storeys)?,
            devices: contiguous("devices", &devices)?,
        };
        Ok(Self { dynamics: Dynamics::new(&matrices).map_err(value_error)? })
    }

    /// Quantities of a run's summary in order, with how many numbers each has.
    #[getter]
    fn summary_layout(&self) -> Vec<(&'static str, usize)> {
        summary_layout(&self.dynamics)
    }

    /// Signals of a history in order, with how many numbers each has.
    #[getter]
    fn history_layout(&self) -> Vec<(&'static str, usize)> {
        history_layout(&self.dynamics)
    }
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
    entry.set_item("wants_curve", spec.wants_curve)?;
    let gains = spec.gains.iter().map(|gain| {
        let entry = PyDict::new(py);
        entry.set_item("name", gain.name)?;
        entry.set_item("unit", gain.unit)?;
        entry.set_item("shape", gain.shape.name())?;
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

/// Runs of a building in closed loop: summaries, shape (`n_runs`, width), how each ended, its steps per sample, and
/// histories, one array per run, where asked for.
///
/// `runs` has a row (candidate, motion, draw) for each; `sensors` a row (noise, resolution) for acceleration, deformation
/// and force.
#[pyfunction]
#[pyo3(signature = (
    building, model, laws, theta, places, ranges, law, gains, tables, curve, motions, runs, streams, sample_time,
    steps, delay_steps, command_rate, sensors, faults, observer, histories=false, step_factor=1, threads=0
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
            Some((parsed_laws(spec, laws.0.clone(), laws.1)?, contiguous("curve", theta)?))
        }
        None => None,
    };
    let curve =
        curve.as_ref().map(|(laws, theta)| CurveModel::new(laws, theta)).transpose().map_err(value_error)?;
    let motions = motions
        .iter()
        .map(|(dt, samples)| {
            GroundMotion::new(*dt, contiguous("acceleration", samples)?).map_err(value_error)
        })
        .collect::<PyResult<Vec<_>>>()?;
    let places: Vec<Place> =
        places.into_iter().map(|(count, differential)| Place { count, differential }).collect();
    let tables =
        tables.iter().map(|table| Ok(contiguous("tables", table)?.to_vec())).collect::<PyResult<Vec<_>>>()?;
    let [acceleration, deformation, force] = sensors.map(|[noise, resolution]| Sensor { noise, resolution });
    let faults = faults.into_iter().map(fault).collect::<PyResult<_>>()?;
    let hardware =
        Hardware { sample_time, steps, delay_steps, command_rate, acceleration, deformation, force, faults };
    let observer = observer.map(observer_of).transpose()?;
    let runs: Vec<Run> = runs
        .as_array()
        .rows()
        .into_iter()
        .zip(streams.as_array())
        .map(|(row, &stream)| Run { candidate: row[0], motion: row[1], draw: row[2], stream })
        .collect();
    let batch = Batch {
        building: &building.dynamics,
        damper,
        laws: &laws,
        theta: theta.as_slice().map_err(|_| PyValueError::new_err("`theta` must be C-contiguous float64"))?,
        places: &places,
        ranges: &ranges,
        law,
        gains: contiguous("gains", &gains)?,
        tables: &tables,
        curve,
        motions: &motions,
        runs: &runs,
        hardware: &hardware,
        observer: observer.as_ref(),
    };
    let width: usize = summary_layout(&building.dynamics).iter().map(|&(_, count)| count).sum();
    let history_width: usize = history_layout(&building.dynamics).iter().map(|&(_, count)| count).sum();
    let mut summary = vec![0.0; runs.len() * width];
    let lengths: Vec<usize> = runs
        .iter()
        .map(|run| motions.get(run.motion as usize).map_or(0, |motion| n_samples(motion, &hardware)))
        .collect();
    let mut rows: Option<Vec<Vec<f64>>> =
        histories.then(|| lengths.iter().map(|&samples| vec![0.0; samples * history_width]).collect());
    let instruction_set = chosen_instruction_set()?;
    let results = interruptible(py, |stop| {
        let settings = Settings { step_factor, threads, instruction_set, stop };
        closed_loop::respond(&batch, &mut summary, rows.as_deref_mut(), settings)
    })?;
    let outcome: Vec<u8> = results.iter().map(|result| result.outcome as u8).collect();
    let steps: Vec<u32> = results.iter().map(|result| result.steps).collect();
    let histories = rows
        .map(|rows| {
            rows.into_iter()
                .zip(lengths)
                .map(|(row, samples)| matrix(py, samples, history_width, row))
                .collect::<PyResult<Vec<_>>>()
        })
        .transpose()?;
    Ok((matrix(py, runs.len(), width, summary)?, outcome.into_pyarray(py), steps.into_pyarray(py), histories))
}

fn matrix(py: Python<'_>, rows: usize, columns: usize, flat: Vec<f64>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let array = Array2::from_shape_vec((rows, columns), flat)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
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

fn observer_of(arguments: ObserverArguments<'_>) -> PyResult<Observer> {
    let (accelerations, deformations, transition, input, gain, output, direct) = arguments;
    let flat = |name: &str, matrix: &Matrix<'_>| Ok::<_, PyErr>(contiguous(name, matrix)?.to_vec());
    Ok(Observer {
        accelerations,
        deformations,
        transition: flat("transition", &transition)?,
        input: flat("input", &input)?,
        gain: flat("gain", &gain)?,
        output: flat("output", &output)?,
        direct: flat("direct", &direct)?,
    })
}
