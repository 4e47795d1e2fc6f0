//! Entry from Python into long computations: releases the interpreter, checks for Ctrl-C, maps errors.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::error::DynamicsError;
use mrwork_dynamics::threads::StopRequested;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

pyo3::import_exception!(mrwork.errors, SettingError);

/// Time between two checks for Ctrl-C.
const WATCH: Duration = Duration::from_millis(20);

/// Environment variable that forces an instruction set; empty is as if it were not set.
const INSTRUCTION_SET: &str = "MRWORK_INSTRUCTION_SET";

/// Environment variable that builds every instruction set from source.
const BUILD_SETS: &str = "MRWORK_BUILD_SETS";

/// How many times slower simulations are without vectors and fused multiply-adds: the smallest ratio to AVX2 that was
/// measured (the loop; batches of the normalised Bouc-Wen model 19 to 20 times, all on an AMD EPYC of family 26).
const SLOWDOWN: u32 = 17;

/// Runs `work` without the interpreter; `work` must often call its argument, which says whether to stop.
///
/// On the calling thread that call checks for an interrupt, which is raised after `work` has returned.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&StopRequested<'_>) -> Result<T, DynamicsError> + Send,
) -> PyResult<T> {
    let watch = Watch::new();
    let result = py.detach(|| catch_unwind(AssertUnwindSafe(|| work(&|| watch.stop_requested()))));
    if let Some(interrupt) = watch.interrupt.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(interrupt);
    }
    match result {
        Ok(result) => result.map_err(refused),
        Err(_) => Err(PyRuntimeError::new_err(
            "a simulation panicked, which is a defect of mrwork; please report it",
        )),
    }
}

/// Checks for an interrupt on the thread that called from Python; the other threads read the result.
struct Watch {
    caller: ThreadId,
    last_look: Mutex<Instant>,
    interrupt: Mutex<Option<PyErr>>,
    stop: AtomicBool,
}

impl Watch {
    fn new() -> Self {
        Self {
            caller: thread::current().id(),
            last_look: Mutex::new(Instant::now()),
            interrupt: Mutex::new(None),
            stop: AtomicBool::new(false),
        }
    }

    fn stop_requested(&self) -> bool {
        if self.stop.load(Ordering::Relaxed) {
            return true;
        }
        if thread::current().id() != self.caller {
            return false;
        }
        let mut last_look = self.last_look.lock().unwrap_or_else(PoisonError::into_inner);
        if last_look.elapsed() < WATCH {
            return false;
        }
        *last_look = Instant::now();
        #[allow(clippy::redundant_closure_for_method_calls)] // the method is too narrow in its lifetime
        if let Err(interrupt) = Python::attach(|py| py.check_signals()) {
            *self.interrupt.lock().unwrap_or_else(PoisonError::into_inner) = Some(interrupt);
            self.stop.store(true, Ordering::Relaxed);
            return true;
        }
        false
    }
}

/// A refusal of input with the sentence of the error.
pub fn refused(error: DynamicsError) -> PyErr {
    SettingError::new_err(error.to_string())
}

/// The instruction set to run on: the fastest, or the one that the environment forces.
pub fn chosen_instruction_set() -> PyResult<InstructionSet> {
    let Some(wanted) = std::env::var_os(INSTRUCTION_SET).filter(|wanted| !wanted.is_empty()) else {
        return InstructionSet::detect().map_err(refused);
    };
    // Quoted and escaped; what is no text has replacement characters.
    let wanted = wanted.to_string_lossy();
    InstructionSet::usable().find(|set| wanted == set.name()).ok_or_else(|| {
        let usable: Vec<_> = InstructionSet::usable().map(InstructionSet::name).collect();
        let usable = usable.join(", ");
        let left_out = InstructionSet::of_processor().any(|name| wanted == name);
        let (which, remedy) = if left_out {
            ("this build of mrwork has", format!("build it from source with {BUILD_SETS}=all, or "))
        } else {
            ("this machine has", String::new())
        };
        SettingError::new_err(format!(
            "{INSTRUCTION_SET} is {wanted:?}, {which} {usable}; {remedy}unset it or name one of these"
        ))
    })
}

/// A sentence where vectors of the processor lie idle because this build has none of them.
pub fn idle_vectors(used: InstructionSet) -> Option<String> {
    let idle: Vec<_> = InstructionSet::of_processor().filter(|&name| name != "plain").collect();
    (used.name() == "plain" && !idle.is_empty()).then(|| {
        format!(
            "this build of mrwork has none of the vector instructions of this machine ({}) and is at least {SLOWDOWN} times \
             slower than it could be: build it again from source with {BUILD_SETS}={} in the environment",
            idle.join(", "),
            idle[0]
        )
    })
}
