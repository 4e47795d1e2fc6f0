//! Formulas of users on tapes, in Python.

use mrwork_dynamics::closed_loop::{Input, OwnLaw, Source};
use mrwork_dynamics::damper::own::{Formulas, Parameter, register};
use mrwork_dynamics::parameters::Scale;
use mrwork_dynamics::tape::{Entry, Operation, Tape};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::arrays::shaped;
use crate::enter::{SettingError, refused};

/// Operations of a tape, in order: name and number of operands.
#[pyfunction]
pub fn tape_operations() -> Vec<(&'static str, usize)> {
    Operation::ALL.iter().map(|operation| (operation.name(), operation.arity())).collect()
}

/// A tape by the names of the fields of `mrwork.base.tape.Tape`.
#[derive(FromPyObject)]
pub struct GivenTape {
    entries: Vec<(String, u16, Vec<u16>)>,
    constants: Vec<f64>,
    table: Vec<f64>,
    ends: Vec<u16>,
    n_inputs: usize,
    n_slots: usize,
}

impl GivenTape {
    fn tape(self) -> PyResult<Tape> {
        let Self { entries, constants, table, ends, n_inputs, n_slots } = self;
        let entries =
            entries.into_iter().map(|(name, to, of)| entry(&name, to, &of)).collect::<PyResult<_>>()?;
        Ok(Tape { entries, constants, table, ends, n_inputs, n_slots })
    }
}

fn entry(name: &str, to: u16, of: &[u16]) -> PyResult<Entry> {
    let named = Operation::ALL.iter().find(|operation| operation.name() == name);
    let Some(&operation) = named.filter(|operation| operation.arity() == of.len()) else {
        return Err(SettingError::new_err(format!(
            "no operation of a tape is called `{name}` with {} operands; a newer version may have it",
            of.len()
        )));
    };
    let mut places = [0; 3];
    places[..of.len()].copy_from_slice(of);
    Ok(Entry { operation, to, of: places })
}

/// Registers a damper of a user under a name that holds its digest: `name`, `unit`, `scale` and smallest, largest and nominal
/// value of each parameter, and tapes whose inputs are parameters, states, displacement and velocity.
#[pyfunction]
pub fn register_damper(
    name: &str,
    parameters: Vec<GivenParameter>,
    n_states: usize,
    force: GivenTape,
    rate: GivenTape,
    relaxation: GivenTape,
) -> PyResult<()> {
    let parameters = parameters.into_iter().map(GivenParameter::parameter).collect::<PyResult<_>>()?;
    let (force, rate, relaxation) = (force.tape()?, rate.tape()?, relaxation.tape()?);
    register(name, Formulas { parameters, n_states, force, rate, relaxation }).map_err(refused)
}

/// A parameter by the names of the fields of `mrwork.dampers.parameters.ParamSpec`.
#[derive(FromPyObject)]
pub struct GivenParameter {
    name: String,
    unit: String,
    scale: String,
    lower: f64,
    upper: f64,
    nominal: f64,
}

impl GivenParameter {
    fn parameter(self) -> PyResult<Parameter> {
        let Self { name, unit, scale, lower, upper, nominal } = self;
        let scale =
            [Scale::Linear, Scale::Log, Scale::Offset].into_iter().find(|known| known.name() == scale);
        let scale = scale.ok_or_else(|| SettingError::new_err("a scale is linear, log or offset"))?;
        Ok(Parameter { name, unit, scale, values: [lower, upper, nominal] })
    }
}

/// A law of a user as a tape.
///
/// Each input has the name of a reading, `memory` or `setting`, its place in that, and whether the law is without a command
/// where it is not a number. What it keeps comes first, in inputs as in results. `settings` has a row for each candidate.
#[pyclass(frozen, module = "mrwork._rust")]
pub struct LawTape {
    pub(crate) law: OwnLaw,
}

#[pymethods]
impl LawTape {
    #[new]
    fn new(
        tape: GivenTape,
        inputs: Vec<(String, usize, bool)>,
        start: Vec<f64>,
        names: Vec<String>,
        settings: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let inputs = inputs
            .into_iter()
            .map(|(name, place, is_needed)| Ok(Input { source: source(&name, place)?, is_needed }))
            .collect::<PyResult<_>>()?;
        let axes = [("candidates", None), ("settings", Some(names.len()))];
        let settings = shaped("settings", &settings, &axes)?.to_vec();
        Ok(Self { law: OwnLaw { tape: tape.tape()?, inputs, start, names, settings } })
    }
}

fn source(name: &str, place: usize) -> PyResult<Source> {
    Ok(match name {
        "memory" => Source::Memory,
        "setting" => Source::Setting(place),
        "displacement" => Source::Displacement(place),
        "velocity" => Source::Velocity(place),
        "deformation" => Source::Deformation(place),
        "rate" => Source::Rate(place),
        "force" => Source::Force(place),
        "acceleration" => Source::Acceleration(place),
        "ground_acceleration" => Source::GroundAcceleration,
        "ground_velocity" => Source::GroundVelocity,
        "drift" => Source::Drift(place),
        "time" => Source::Time,
        other => return Err(SettingError::new_err(format!("no input of a law is called `{other}`"))),
    })
}
