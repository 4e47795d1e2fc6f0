//! A building and its dampers in Python: what is simulated in closed loop, and what a controller has as its model of the loop.

use mrwork_dynamics::any_damper::Damper;
use mrwork_dynamics::building::{Building as Dynamics, Element, Matrices, Springs};
use mrwork_dynamics::closed_loop::{HISTORY_SIGNALS, Quantity, RUN_QUANTITIES};
use mrwork_dynamics::coupled::{Group, Mounting};
use mrwork_dynamics::current_law::CurrentLaws;
use mrwork_dynamics::damper::find_device;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyLookupError;
use pyo3::prelude::*;

use crate::arrays::{contiguous, shaped, with_shape};
use crate::damper::parsed_laws;
use crate::enter::refused;

/// A passive element of a building, by the names of its numbers in Python.
#[derive(FromPyObject)]
struct PassiveElement<'py> {
    row: PyReadonlyArray1<'py, f64>,
    stiffness: f64,
    damping: f64,
    head_loss: f64,
    yield_force: f64,
    yield_displacement: f64,
    sharpness: f64,
    in_stiffness: bool,
}

impl PassiveElement<'_> {
    fn numbers(&self) -> Element {
        let Self { stiffness, damping, head_loss, yield_force, sharpness, .. } = *self;
        let (slope, in_frame) = (1.0 / self.yield_displacement, self.in_stiffness);
        Element { stiffness, damping, head_loss, yield_force, slope, sharpness, in_frame }
    }
}

/// Matrices of a building, with a row for each of its devices; other damping and stiffness that runs may have.
#[pyclass(frozen, module = "mrwork._rust")]
pub struct Building {
    pub(crate) dynamics: Dynamics,
    pub(crate) springs: Vec<Springs>,
}

#[pymethods]
impl Building {
    #[new]
    #[pyo3(signature = (
        mass, damping, stiffness, influence, floors, storeys, unit_drifts, heights, storey_springs, devices,
        sprung, elements,
        varied=Vec::new()
    ))]
    #[allow(clippy::too_many_arguments)] // the matrices of one equation
    fn new(
        mass: PyReadonlyArray2<'_, f64>,
        damping: PyReadonlyArray2<'_, f64>,
        stiffness: PyReadonlyArray2<'_, f64>,
        influence: PyReadonlyArray1<'_, f64>,
        floors: PyReadonlyArray2<'_, f64>,
        storeys: PyReadonlyArray2<'_, f64>,
        unit_drifts: PyReadonlyArray2<'_, f64>,
        heights: PyReadonlyArray1<'_, f64>,
        storey_springs: PyReadonlyArray1<'_, f64>,
        devices: PyReadonlyArray2<'_, f64>,
        sprung: PyReadonlyArray2<'_, f64>,
        elements: Vec<PassiveElement<'_>>,
        varied: Vec<(PyReadonlyArray2<'_, f64>, PyReadonlyArray2<'_, f64>)>,
    ) -> PyResult<Self> {
        let columns = ("coordinates", Some(influence.len()));
        let square = [columns; 2];
        let rows: PyResult<Vec<_>> =
            elements.iter().map(|element| shaped("row of an element", &element.row, &[columns])).collect();
        let element_parameters: Vec<Element> = elements.iter().map(PassiveElement::numbers).collect();
        let matrices = Matrices {
            mass: shaped("mass", &mass, &square)?,
            damping: shaped("damping", &damping, &square)?,
            stiffness: shaped("stiffness", &stiffness, &square)?,
            influence: contiguous("influence", &influence)?,
            floors: shaped("floors", &floors, &[("floors", None), columns])?,
            storeys: shaped("storeys", &storeys, &[("storeys", None), columns])?,
            unit_drifts: shaped("unit_drifts", &unit_drifts, &[("storeys", None), columns])?,
            heights: contiguous("heights", &heights)?,
            storey_springs: contiguous("storey_springs", &storey_springs)?,
            devices: shaped("devices", &devices, &[("devices", None), columns])?,
            sprung: shaped("sprung", &sprung, &[("devices", Some(devices.shape()[0])), columns])?,
            elements: &rows?.concat(),
            element_parameters: &element_parameters,
        };
        let dynamics = Dynamics::new(&matrices).map_err(refused)?;
        let springs = varied.iter().map(|(damping, stiffness)| {
            let damping = shaped("varied damping", damping, &square)?;
            dynamics.with_springs(damping, shaped("varied stiffness", stiffness, &square)?).map_err(refused)
        });
        Ok(Self { springs: springs.collect::<PyResult<_>>()?, dynamics })
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

/// Dampers of one model with current laws: parameters, shape (draws, devices, columns), and each device's number of
/// dampers, arrangement and range of the command.
#[pyclass(frozen, module = "mrwork._rust")]
pub struct Dampers {
    pub(crate) model: &'static dyn Damper,
    pub(crate) laws: CurrentLaws,
    pub(crate) theta: Vec<f64>,
    pub(crate) mountings: Vec<Mounting>,
    pub(crate) ranges: Vec<[f64; 2]>,
}

#[pymethods]
impl Dampers {
    #[new]
    #[pyo3(signature = (model, theta, counts, differential, ranges, laws=None, rates=0))]
    #[allow(clippy::too_many_arguments)] // plain values, by keyword from Python
    fn new(
        model: &str,
        theta: PyReadonlyArray3<'_, f64>,
        counts: Vec<f64>,
        differential: Vec<bool>,
        ranges: Vec<[f64; 2]>,
        laws: Option<Vec<String>>,
        rates: usize,
    ) -> PyResult<Self> {
        let n_devices = counts.len();
        for (name, found) in [("differential", differential.len()), ("ranges", ranges.len())] {
            with_shape(name, &[found], &[("devices", Some(n_devices))])?;
        }
        let model = find_device(model)
            .ok_or_else(|| PyLookupError::new_err(format!("no damper model is called `{model}`")))?;
        let laws = parsed_laws(model.spec(), laws, rates)?;
        let axes = [("draws", None), ("devices", Some(n_devices)), ("columns", Some(laws.n_columns()))];
        let theta = shaped("theta", &theta, &axes)?.to_vec();
        let mountings = counts
            .into_iter()
            .zip(differential)
            .map(|(count, differential)| Mounting { count, differential })
            .collect();
        Ok(Self { model, laws, theta, mountings, ranges })
    }
}

impl Dampers {
    /// The dampers for the core.
    pub fn group(&self) -> Group<'_> {
        Group { damper: self.model, laws: &self.laws, theta: &self.theta, mountings: &self.mountings }
    }
}
