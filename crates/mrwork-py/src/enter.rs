//! The one door from Python into long-running Rust: frees the interpreter, watches for Ctrl-C, maps errors.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::error::DynamicsError;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// Time between two looks for Ctrl-C.
const WATCH: Duration = Duration::from_millis(20);

/// Environment variable that forces an instruction set.
const INSTRUCTION_SET: &str = "MRWORK_INSTRUCTION_SET";

/// Runs `work` on a thread of its own while this one waits for it or for an interrupt.
///
/// On an interrupt `work` is told to stop through its flag, and the interrupt is raised when it has.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> Result<T, DynamicsError> + Send,
) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    py.detach(|| {
        thread::scope(|scope| {
            let (running, finished) = channel::<()>();
            let stop = &stop;
            let worker = scope.spawn(move || {
                // Dropped when the work ends, however it ends; that wakes the thread that waits.
                let _running = running;
                work(stop)
            });
            let mut interrupt = None;
            while finished.recv_timeout(WATCH) == Err(RecvTimeoutError::Timeout) {
                if interrupt.is_none() {
                    #[allow(clippy::redundant_closure_for_method_calls)]
                    // the method is not general enough in its lifetime
                    let signals = Python::attach(|py| py.check_signals());
                    interrupt = signals.err();
                }
                if interrupt.is_some() {
                    stop.store(true, Ordering::Relaxed);
                }
            }
            let result = worker.join().map_err(|_| {
                PyRuntimeError::new_err(
                    "a simulation thread panicked, which is a defect of mrwork; please report it",
                )
            })?;
            match interrupt {
                Some(interrupt) => Err(interrupt),
                None => result.map_err(value_error),
            }
        })
    })
}

/// A `ValueError` with the sentence of the error.
pub fn value_error(error: DynamicsError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// The instruction set to run on: the fastest, or the one that the environment forces.
pub fn chosen_instruction_set() -> PyResult<InstructionSet> {
    let Ok(wanted) = std::env::var(INSTRUCTION_SET) else {
        return Ok(InstructionSet::detect());
    };
    InstructionSet::ALL.into_iter().find(|set| set.name() == wanted && set.is_supported()).ok_or_else(|| {
        let usable: Vec<&str> = InstructionSet::ALL
            .into_iter()
            .filter(|set| set.is_supported())
            .map(InstructionSet::name)
            .collect();
        PyValueError::new_err(format!(
            "{INSTRUCTION_SET} is {wanted:?}, this machine has {}; unset it or name one of these",
            usable.join(", ")
        ))
    })
}
