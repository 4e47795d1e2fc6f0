//! The compiled module `mrwork._rust`: converts and checks arguments, releases the interpreter, maps errors.

#![allow(clippy::needless_pass_by_value)] // pyo3 hands arguments over by value

mod arrays;
mod asked_law;
mod closed_loop;
mod control;
mod coupled;
mod damper;
mod enter;
mod loading;
mod machine;
mod matrix_equations;
mod own;
mod printed;
mod xla;

use pyo3::prelude::*;
use pyo3::types::PyModule;

use crate::enter::idle_vectors;

#[pymodule]
mod _rust {
    use std::ffi::CString;

    use mrwork_dynamics::dispatch::InstructionSet;

    use super::{Bound, PyAnyMethods, PyErr, PyModule, PyModuleMethods, PyResult, idle_vectors};

    #[pymodule_export]
    use crate::closed_loop::{Observer, history_signals, respond, run_quantities};
    #[pymodule_export]
    use crate::control::{Controller, ForceCurve, LoopModel, control_laws};
    #[pymodule_export]
    use crate::coupled::{Building, Dampers};
    #[pymodule_export]
    use crate::damper::{
        current_laws, damper_specs, force, force_histories, misfits, rate, sensitivities, stiffness_shares,
    };
    #[pymodule_export]
    use crate::loading::LoadingHistory;
    #[pymodule_export]
    use crate::machine::{flops_per_step, fma_peak, instruction_set, instruction_sets};
    #[pymodule_export]
    use crate::matrix_equations::riccati_equations;
    #[pymodule_export]
    use crate::own::{LawTape, register_damper, tape_operations};
    #[pymodule_export]
    use crate::printed::{
        damper_text, elementary_functions, law_commands, law_readings, law_text, straight_forces,
    };
    #[pymodule_export]
    use crate::xla::xla_handler;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Classes of the package: the command shows their sentence in one line on stderr, and hides warnings of libraries.
        let class = |name: &str| module.py().import("mrwork.errors")?.getattr(name);
        let used = match InstructionSet::detect() {
            Ok(used) => used,
            Err(error) => return Err(PyErr::from_value(class("LibraryError")?.call1((error.to_string(),))?)),
        };
        if let Some(sentence) = idle_vectors(used) {
            PyErr::warn(module.py(), &class("MrworkWarning")?, &CString::new(sentence)?, 1)?;
        }
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
