//! Riccati and Lyapunov equations in batches.

use mrwork_dynamics::matrix_equations::{self, Equations, Stack, Time};
use numpy::ndarray::Ix3;
use numpy::{IntoPyArray, PyArray1, PyArray3, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{array_of, shaped, zeros};
use crate::enter::{SettingError, chosen_instruction_set, interruptible};

type Matrices<'py> = PyReadonlyArray3<'py, f64>;

/// Gains K of `f = -K s`, shape (`n_batch`, m, n), and P, shape (`n_batch`, n, n), of Riccati equations, with the residual
/// and the status of each row; gain and P are infinite in a row that is not solved.
///
/// Each matrix has a leading axis of `n_batch`, or of 1 if all rows share it.
#[pyfunction]
#[pyo3(signature = (
    time, state, control, state_weight, control_weight, cross_weight=None, scaling=None, threads=0
))]
#[allow(clippy::too_many_arguments)] // a boundary function takes plain values, by keyword from Python
#[allow(clippy::type_complexity)] // the results of one call
pub fn riccati_equations<'py>(
    py: Python<'py>,
    time: &str,
    state: Matrices<'py>,
    control: Matrices<'py>,
    state_weight: Matrices<'py>,
    control_weight: Matrices<'py>,
    cross_weight: Option<Matrices<'py>>,
    scaling: Option<Matrices<'py>>,
    threads: usize,
) -> PyResult<(
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u8>>,
)> {
    let time = match time {
        "continuous" => Time::Continuous,
        "discrete" => Time::Discrete,
        other => {
            return Err(SettingError::new_err(format!(
                "`time` is {other:?}; give \"continuous\" or \"discrete\""
            )));
        }
    };
    let given = [Some(&state), Some(&control), Some(&state_weight), Some(&control_weight)];
    let n_batch = given
        .into_iter()
        .chain([cross_weight.as_ref(), scaling.as_ref()])
        .flatten()
        .map(|array| array.shape()[0])
        .find(|&rows| rows != 1)
        .unwrap_or(1);
    let (n, m) = (state.shape()[1], control.shape()[2]);
    let equations = Equations {
        n_batch,
        n_states: n,
        n_controls: m,
        time,
        state: stack("state", &state, n_batch, ("n_states", n), ("n_states", n))?,
        control: stack("control", &control, n_batch, ("n_states", n), ("n_controls", m))?,
        state_weight: stack("state_weight", &state_weight, n_batch, ("n_states", n), ("n_states", n))?,
        control_weight: stack(
            "control_weight",
            &control_weight,
            n_batch,
            ("n_controls", m),
            ("n_controls", m),
        )?,
        cross_weight: cross_weight
            .as_ref()
            .map(|cross| stack("cross_weight", cross, n_batch, ("n_states", n), ("n_controls", m)))
            .transpose()?,
        scaling: scaling
            .as_ref()
            .map(|scaling| stack("scaling", scaling, n_batch, ("n_states", n), ("n_states", n)))
            .transpose()?,
    };
    let instruction_set = chosen_instruction_set()?;
    let mut gain = zeros(&[n_batch, m, n])?;
    let mut riccati = zeros(&[n_batch, n, n])?;
    let solutions = interruptible(py, |stop| {
        matrix_equations::solve(&equations, &mut gain, &mut riccati, threads, instruction_set, stop)
    })?;
    let residual: Vec<f64> = solutions.iter().map(|solution| solution.residual).collect();
    let status: Vec<u8> = solutions.iter().map(|solution| solution.status as u8).collect();
    Ok((
        array_of(Ix3(n_batch, m, n), gain)?.into_pyarray(py),
        array_of(Ix3(n_batch, n, n), riccati)?.into_pyarray(py),
        residual.into_pyarray(py),
        status.into_pyarray(py),
    ))
}

/// The matrices of a batch, one for each row or one for all.
fn stack<'a>(
    name: &'static str,
    array: &'a Matrices<'_>,
    n_batch: usize,
    (row, rows): (&'static str, usize),
    (column, columns): (&'static str, usize),
) -> PyResult<Stack<'a>> {
    let leading = if array.shape()[0] == 1 { 1 } else { n_batch };
    let axes = [("n_batch", Some(leading)), (row, Some(rows)), (column, Some(columns))];
    Ok(Stack::new(shaped(name, array, &axes)?, rows * columns))
}
