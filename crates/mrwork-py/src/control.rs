//! Control laws in Python, and a law with its gains.

use mrwork_dynamics::closed_loop::Shaping;
use mrwork_dynamics::control::{CurveModel, Law, LawSpec, LoopModel as DynamicsModel, LoopSizes, Unit};
use mrwork_dynamics::current_law::CurrentLaws;
use mrwork_dynamics::damper::find;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyLookupError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{contiguous, shaped, with_shape};
use crate::coupled::{Building, Dampers};
use crate::damper::parsed_laws;
use crate::enter::refused;

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
    entry.set_item("needs_model", spec.needs_model)?;
    entry.set_item("commands_force", spec.commands_force)?;
    entry.set_item("reads_acceleration", spec.reads_acceleration)?;
    entry.set_item("reads_sprung", spec.reads_sprung)?;
    entry.set_item("switches", spec.switches)?;
    let gains = spec.gains.iter().map(|gain| {
        let entry = PyDict::new(py);
        entry.set_item("name", gain.name)?;
        entry.set_item("unit", gain.unit.name())?;
        entry.set_item("is_command", gain.unit == Unit::Command)?;
        entry.set_item("scales_with_command", gain.unit.has_command())?;
        entry.set_item("shape", gain.shape.name())?;
        entry.set_item("numbers", gain.shape.numbers())?;
        entry.set_item("description", gain.description)?;
        Ok(entry)
    });
    entry.set_item("gains", gains.collect::<PyResult<Vec<_>>>()?)?;
    Ok(entry)
}

/// The damper force as a function of the command, by a static hysteretic model with current laws.
#[pyclass(frozen, module = "mrwork._rust")]
pub struct ForceCurve {
    laws: CurrentLaws,
    theta: Vec<f64>,
}

#[pymethods]
impl ForceCurve {
    #[new]
    #[pyo3(signature = (laws, theta, rates=0))]
    fn new(laws: Vec<String>, theta: PyReadonlyArray1<'_, f64>, rates: usize) -> PyResult<Self> {
        let model =
            find("static_hysteretic").ok_or_else(|| PyLookupError::new_err("no static_hysteretic"))?;
        let laws = parsed_laws(model.spec(), Some(laws), rates)?;
        let theta = shaped("theta", &theta, &[("columns", Some(laws.n_columns()))])?.to_vec();
        Ok(Self { laws, theta })
    }
}

/// The controller's own model of the loop: a building and its dampers, with one draw of their parameters.
#[pyclass(frozen, module = "mrwork._rust")]
pub struct LoopModel {
    building: Py<Building>,
    dampers: Vec<Py<Dampers>>,
}

#[pymethods]
impl LoopModel {
    #[new]
    fn new(building: Py<Building>, dampers: Vec<Py<Dampers>>) -> Self {
        Self { building, dampers }
    }
}

/// A control law with the gains of its candidates, its tables, its models of the dampers and of the loop, and the dead zone
/// and slope of the command of each candidate, shape (candidates, 2).
#[pyclass(frozen, module = "mrwork._rust")]
pub struct Controller {
    pub(crate) law: Law,
    pub(crate) tables: Vec<Vec<f64>>,
    pub(crate) shaping: Vec<Shaping>,
    gains: Vec<f64>,
    shape: Vec<usize>,
    curve: Option<Py<ForceCurve>>,
    model: Option<Py<LoopModel>>,
}

#[pymethods]
impl Controller {
    #[new]
    #[pyo3(signature = (law, gains, tables=Vec::new(), curve=None, shaping=None, model=None))]
    fn new(
        law: &str,
        gains: PyReadonlyArray2<'_, f64>,
        tables: Vec<PyReadonlyArray1<'_, f64>>,
        curve: Option<Py<ForceCurve>>,
        shaping: Option<PyReadonlyArray2<'_, f64>>,
        model: Option<Py<LoopModel>>,
    ) -> PyResult<Self> {
        let law = Law::find(law)
            .ok_or_else(|| PyLookupError::new_err(format!("no control law is called `{law}`")))?;
        let tables = tables.iter().map(|table| Ok(contiguous("tables", table)?.to_vec()));
        let shaping = match &shaping {
            Some(rows) => {
                let axes = [("candidates", Some(gains.shape()[0])), ("dead zone and slope", Some(2))];
                let (rows, _) = shaped("shaping", rows, &axes)?.as_chunks::<2>();
                rows.iter().map(|&[dead_zone, slope]| Shaping { dead_zone, slope }).collect()
            }
            None => Vec::new(),
        };
        Ok(Self {
            law,
            shaping,
            tables: tables.collect::<PyResult<_>>()?,
            gains: contiguous("gains", &gains)?.to_vec(),
            shape: gains.shape().to_vec(),
            curve,
            model,
        })
    }
}

impl Controller {
    /// The gains, shape (candidates, gains), of a loop with these numbers of devices and states.
    pub fn gains(&self, n_devices: usize, n_states: usize) -> PyResult<&[f64]> {
        let n_gains = self.law.spec().n_gains(LoopSizes { n_devices, n_states });
        with_shape("gains", &self.shape, &[("candidates", None), ("gains", Some(n_gains))])?;
        Ok(&self.gains)
    }

    /// Its model of the dampers.
    pub fn curve(&self) -> PyResult<Option<CurveModel<'_>>> {
        let curve = self.curve.as_ref().map(Py::get);
        curve.map(|curve| CurveModel::new(&curve.laws, &curve.theta).map_err(refused)).transpose()
    }

    /// Its model of the loop.
    pub fn model(&self) -> Option<DynamicsModel<'_>> {
        let model = self.model.as_ref().map(Py::get)?;
        let dampers = model.dampers.iter().map(|dampers| dampers.get().group()).collect();
        Some(DynamicsModel { building: &model.building.get().dynamics, dampers })
    }
}
