//! What the machine can do, for provenance and benchmarks.

use mrwork_dynamics::peak;
use numpy::{PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::damper::{check_count, named};
use crate::enter::{chosen_instruction_set, interruptible};
use crate::loading::contiguous;

/// Name of the instruction set that batches run on.
#[pyfunction]
pub fn instruction_set() -> PyResult<&'static str> {
    Ok(chosen_instruction_set()?.name())
}

/// Peak rate of fused multiply-adds [flop/s] on that many threads, measured for about `seconds`.
#[pyfunction]
pub fn fma_peak(py: Python<'_>, threads: usize, seconds: f64) -> PyResult<f64> {
    let set = chosen_instruction_set()?;
    interruptible(py, |_| peak::fma_peak(set, threads, seconds))
}

/// Arithmetic operations of one integration step and one residual.
#[pyfunction]
pub fn flops_per_step(model: &str, theta: PyReadonlyArray1<'_, f64>) -> PyResult<u64> {
    let damper = named(model)?;
    check_count(damper, theta.len())?;
    Ok(damper.flops_per_step(contiguous("theta", &theta)?))
}
