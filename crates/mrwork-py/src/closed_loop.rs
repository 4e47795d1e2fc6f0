//! Buildings in closed loop, in Python.

use mrwork_dynamics::closed_loop::{
    self, Batch, Channel, Directions, Fault, HISTORY_SIGNALS, Hardware, Observer as DiscreteObserver,
    OutsideLaw, Quantity, RUN_QUANTITIES, Run, Sensor, n_samples,
};
use mrwork_dynamics::coupled::Group;
use mrwork_dynamics::ground_motion::GroundMotion;
use mrwork_dynamics::settings::Settings;
use numpy::ndarray::{Ix2, Ix3};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::arrays::{Axis, array_of, contiguous, shaped, zeros};
use crate::asked_law::AskedLaw;
use crate::control::Controller;
use crate::coupled::{Building, Dampers};
use crate::enter::{SettingError, chosen_instruction_set, interruptible, refused};
use crate::own::LawTape;

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

/// An observer, with the numbers of the floors and devices whose acceleration and elongation are measured; the drifts of the
/// hardware follow them.
#[pyclass(frozen, module = "mrwork._rust")]
pub struct Observer {
    pub(crate) dynamics: DiscreteObserver,
}

#[pymethods]
impl Observer {
    #[new]
    #[pyo3(signature = (
        accelerations, deformations, transition, input, gain, output, direct, ground=None, direct_ground=None,
        is_absolute=false
    ))]
    #[allow(clippy::too_many_arguments)] // the matrices of one equation
    fn new(
        accelerations: Vec<usize>,
        deformations: Vec<usize>,
        transition: PyReadonlyArray2<'_, f64>,
        input: PyReadonlyArray2<'_, f64>,
        gain: PyReadonlyArray2<'_, f64>,
        output: PyReadonlyArray2<'_, f64>,
        direct: PyReadonlyArray2<'_, f64>,
        ground: Option<PyReadonlyArray1<'_, f64>>,
        direct_ground: Option<PyReadonlyArray1<'_, f64>>,
        is_absolute: bool,
    ) -> PyResult<Self> {
        let column = |name: &str, column: Option<PyReadonlyArray1<'_, f64>>| {
            column.map_or(Ok(Vec::new()), |column| Ok::<_, PyErr>(contiguous(name, &column)?.to_vec()))
        };
        let states = ("states", Some(transition.shape()[0]));
        let devices = ("devices", Some(input.shape()[1]));
        let measurements = ("measurements", Some(gain.shape()[1]));
        let flat = |name: &str, matrix: &PyReadonlyArray2<'_, f64>, axes: [Axis; 2]| {
            Ok::<_, PyErr>(shaped(name, matrix, &axes)?.to_vec())
        };
        Ok(Self {
            dynamics: DiscreteObserver {
                transition: flat("transition", &transition, [states, states])?,
                input: flat("input", &input, [states, devices])?,
                gain: flat("gain", &gain, [states, measurements])?,
                output: flat("output", &output, [measurements, states])?,
                direct: flat("direct", &direct, [measurements, devices])?,
                ground: column("ground", ground)?,
                direct_ground: column("direct_ground", direct_ground)?,
                accelerations,
                deformations,
                is_absolute,
            },
        })
    }
}

/// The hardware of a loop, by the names of its settings in Python.
#[derive(FromPyObject)]
pub struct LoopHardware {
    sample_time: f64,
    steps: u32,
    delay_steps: usize,
    command_rate: f64,
    ground_preview: f64,
    acceleration_noise: f64,
    acceleration_resolution: f64,
    deformation_noise: f64,
    deformation_resolution: f64,
    measured_storeys: Vec<usize>,
    drift_noise: f64,
    drift_resolution: f64,
    force_noise: f64,
    force_resolution: f64,
    ground_acceleration_noise: f64,
    ground_acceleration_resolution: f64,
    sampled_faults: Vec<SampledFault>,
}

/// A fault from sample `start` up to `end`, with the value during it; the last one before is held where there is none.
#[derive(FromPyObject)]
struct SampledFault {
    channel: String,
    index: usize,
    start: usize,
    end: usize,
    value: Option<f64>,
}

impl LoopHardware {
    pub fn dynamics(self) -> PyResult<Hardware> {
        Ok(Hardware {
            sample_time: self.sample_time,
            steps: self.steps,
            delay_steps: self.delay_steps,
            command_rate: self.command_rate,
            ground_preview: self.ground_preview,
            acceleration: Sensor { noise: self.acceleration_noise, resolution: self.acceleration_resolution },
            deformation: Sensor { noise: self.deformation_noise, resolution: self.deformation_resolution },
            measured_storeys: self.measured_storeys,
            drift: Sensor { noise: self.drift_noise, resolution: self.drift_resolution },
            force: Sensor { noise: self.force_noise, resolution: self.force_resolution },
            ground_acceleration: Sensor {
                noise: self.ground_acceleration_noise,
                resolution: self.ground_acceleration_resolution,
            },
            faults: self.sampled_faults.into_iter().map(SampledFault::dynamics).collect::<PyResult<_>>()?,
        })
    }
}

impl SampledFault {
    fn dynamics(self) -> PyResult<Fault> {
        let Self { index, start, end, value, .. } = self;
        let channel = match self.channel.as_str() {
            "acceleration" => Channel::Acceleration(index),
            "deformation" => Channel::Deformation(index),
            "force" => Channel::Force(index),
            "command" => Channel::Command(index),
            "ground_acceleration" if index == 0 => Channel::GroundAcceleration,
            "drift" => Channel::Drift(index),
            other => {
                return Err(SettingError::new_err(format!(
                    "a fault is in acceleration, deformation, force, command, drift or the one ground_acceleration, not \
                     in `{other}` {index}"
                )));
            }
        };
        Ok(Fault { channel, start, end, value })
    }
}

/// Rows (candidate, motion, draw, varied damping and stiffness of the building, steps of delay), and their noise.
fn runs_of(rows: &PyReadonlyArray2<'_, u32>, streams: &PyReadonlyArray1<'_, u64>) -> PyResult<Vec<Run>> {
    let axes = [("runs", None), ("candidate, motion, draw, building and delay", Some(5))];
    let (rows, _) = shaped("runs", rows, &axes)?.as_chunks::<5>();
    let streams = shaped("streams", streams, &[("runs", Some(rows.len()))])?;
    let run = |(&[candidate, motion, draw, springs, delay_steps], &stream): (&[u32; 5], &u64)| Run {
        candidate,
        motion,
        draw,
        springs,
        delay_steps,
        stream,
    };
    Ok(rows.iter().zip(streams).map(run).collect())
}

/// Groups of dampers, and the range of the command of each device.
pub fn groups_of(dampers: &[Py<Dampers>]) -> (Vec<Group<'_>>, Vec<[f64; 2]>) {
    let groups = dampers.iter().map(|dampers| dampers.get().group()).collect();
    (groups, dampers.iter().flat_map(|dampers| dampers.get().ranges.clone()).collect())
}

type Responses<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<u32>>,
    Option<Vec<Bound<'py, PyArray2<f64>>>>,
    Option<Bound<'py, PyArray3<f64>>>,
);

/// Runs of a building in closed loop: summaries, shape (`n_runs`, width), outcomes, integration steps per sample, and, if
/// requested, histories, one array per run.
///
/// `motions` are the time step, the acceleration and, shape (floors, samples), forces on
/// floors, of none with no row; `runs` has a row (candidate, motion, draw, varied damping and
/// stiffness of the building, steps of delay beyond those of the hardware) for each run.
/// The law commands the first `n_commanded` devices, by default all; the others hold their smallest command.
/// `own` is a law of the user on a tape, and `outside` one in Python, see [`AskedLaw`]: each commands instead of that of the
/// controller.
/// With `changes` of the gains along directions, shape (candidates, directions, gains), there are last the derivatives of the
/// summaries along them, shape (`n_runs`, directions, width).
#[pyfunction]
#[pyo3(signature = (
    building, dampers, controller, hardware, motions, runs, streams, observer=None, histories=false, step_factor=1,
    threads=0, outside=None, changes=None, n_commanded=None, own=None
))]
#[allow(clippy::too_many_arguments)] // a boundary function takes what it needs by keyword from Python
pub fn respond<'py>(
    py: Python<'py>,
    building: &Building,
    dampers: Vec<Py<Dampers>>,
    controller: &Controller,
    hardware: LoopHardware,
    motions: Vec<(f64, PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>, bool)>,
    runs: PyReadonlyArray2<'py, u32>,
    streams: PyReadonlyArray1<'py, u64>,
    observer: Option<&Observer>,
    histories: bool,
    step_factor: u32,
    threads: usize,
    outside: Option<Py<PyAny>>,
    changes: Option<PyReadonlyArray3<'py, f64>>,
    n_commanded: Option<usize>,
    own: Option<&LawTape>,
) -> PyResult<Responses<'py>> {
    let motions = motions
        .iter()
        .map(|(dt, samples, forces, is_absolute)| {
            let motion = GroundMotion::new(*dt, contiguous("acceleration", samples)?).map_err(refused)?;
            let axes = [("floors", None), ("samples", Some(samples.len()))];
            let rows = shaped("forces", forces, &axes)?.chunks_exact(samples.len());
            let motion = motion.with_absolute_state(*is_absolute);
            motion.with_forces(rows.map(<[f64]>::to_vec).collect()).map_err(refused)
        })
        .collect::<PyResult<Vec<_>>>()?;
    let hardware = hardware.dynamics()?;
    let n_coordinates = building.dynamics.n_coordinates();
    let (groups, ranges) = groups_of(&dampers);
    let n_commanded = n_commanded.unwrap_or(ranges.len());
    let runs = runs_of(&runs, &streams)?;
    let outside =
        outside.map(|law| AskedLaw::new(law, n_coordinates, n_commanded, building.dynamics.n_floors()));
    let batch = Batch {
        building: &building.dynamics,
        springs: &building.springs,
        dampers: &groups,
        ranges: &ranges,
        n_commanded,
        law: controller.law,
        own: own.map(|own| &own.law),
        outside: outside.as_ref().map(|law| law as &dyn OutsideLaw),
        gains: controller.gains(n_commanded, 2 * n_coordinates)?,
        tables: &controller.tables,
        shaping: &controller.shaping,
        curve: controller.curve()?,
        model: controller.model(),
        motions: &motions,
        runs: &runs,
        hardware: &hardware,
        observer: observer.map(|observer| &observer.dynamics),
    };
    batch.check().map_err(refused)?;
    let directions = match &changes {
        Some(_) if histories || own.is_some() || outside.is_some() => {
            return Err(SettingError::new_err("changes go with neither histories nor a law of the user"));
        }
        Some(changes) => {
            let axes = [("candidates", None), ("directions", None), ("gains", None)];
            Some(Directions { count: changes.shape()[1], changes: shaped("changes", changes, &axes)? })
        }
        None => None,
    };
    let width = closed_loop::width(RUN_QUANTITIES, &building.dynamics);
    let history_width = closed_loop::width(HISTORY_SIGNALS, &building.dynamics);
    let mut summary = zeros(&[runs.len(), width])?;
    let lengths: Vec<usize> =
        runs.iter().map(|run| n_samples(&motions[run.motion as usize], &hardware) + 1).collect();
    let mut rows: Option<Vec<Vec<f64>>> = histories
        .then(|| lengths.iter().map(|&samples| zeros(&[samples, history_width])).collect())
        .transpose()?;
    let n_directions = directions.map_or(0, |directions| directions.count);
    let mut slopes = zeros(&[runs.len(), n_directions, width])?;
    let instruction_set = chosen_instruction_set()?;
    // A law in Python is asked by the calling thread only.
    let threads = if outside.is_some() { 1 } else { threads };
    let results = interruptible(py, |stop| {
        let stop = &|| stop() || outside.as_ref().is_some_and(AskedLaw::failed);
        let settings = Settings { step_factor, threads, instruction_set, stop };
        match directions {
            None => closed_loop::respond(&batch, &mut summary, rows.as_deref_mut(), settings),
            Some(directions) => {
                closed_loop::respond_with_slopes(&batch, directions, &mut summary, &mut slopes, settings)
            }
        }
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
    let slopes = directions
        .map(|_| array_of(Ix3(runs.len(), n_directions, width), slopes).map(|slopes| slopes.into_pyarray(py)))
        .transpose()?;
    let summary = array_of(Ix2(runs.len(), width), summary)?.into_pyarray(py);
    Ok((summary, outcome.into_pyarray(py), steps.into_pyarray(py), histories, slopes))
}
