//! Instruction set, peak rate and operation counts, for provenance and benchmarks.

use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::peak;
use numpy::{PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::contiguous;
use crate::damper::{check_count, named};
use crate::enter::{SettingError, chosen_instruction_set, interruptible};

const MOST_THREADS: usize = 1024;
const LONGEST: f64 = 60.0;

/// Name of the instruction set that batches run on.
#[pyfunction]
pub fn instruction_set() -> PyResult<&'static str> {
    Ok(chosen_instruction_set()?.name())
}

/// Names of the instruction sets of this build, and of those that this processor has, fastest first.
#[pyfunction]
pub fn instruction_sets() -> (Vec<&'static str>, Vec<&'static str>) {
    (InstructionSet::of_build().collect(), InstructionSet::of_processor().collect())
}

/// Peak rate of fused multiply-adds [flop/s] on that many threads, measured for about `seconds`.
#[pyfunction]
pub fn fma_peak(py: Python<'_>, threads: usize, seconds: f64) -> PyResult<f64> {
    if threads > MOST_THREADS || !(0.0..=LONGEST).contains(&seconds) {
        return Err(SettingError::new_err(format!(
            "{threads} threads for {seconds} s were asked for; give at most {MOST_THREADS} threads and {LONGEST} s"
        )));
    }
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
