//! Forces of dampers and their derivatives as an operation of XLA, which JAX calls from compiled programs.
//!
//! XLA calls [`handle`] on threads of its own, without Python: nothing there may call Python or look at signals. These
//! threads flush subnormal numbers to zero; the handler computes as the rest of the process does, so that its bits are
//! those of the other functions of this module. The structs are those of `xla/ffi/api/c_api.h`, version 0.3.

#![allow(unsafe_code)] // the interface of XLA is one of C pointers

use std::borrow::Cow;
use std::ffi::{CString, c_char, c_int, c_void};
use std::mem::offset_of;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;
use std::sync::OnceLock;

use mrwork_dynamics::current_law::{CurrentLaw, CurrentLaws};
use mrwork_dynamics::damper::{Motion, Severity, find};
use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::error::{DynamicsError, Outcome};
use mrwork_dynamics::lag::Lag;
use mrwork_dynamics::loading::LoadingHistory;
use mrwork_dynamics::sensitivity::sensitivities;
use mrwork_dynamics::settings::Settings;
use mrwork_dynamics::simulate::force_histories;
use pyo3::prelude::*;

use crate::enter::chosen_instruction_set;

/// The version of the interface that the handler speaks.
const VERSION: [c_int; 2] = [0, 3];

/// The instruction set, chosen when Python asks for the handler: other threads cannot read the environment safely.
static INSTRUCTION_SET: OnceLock<InstructionSet> = OnceLock::new();

/// Address of the handler, for `jax.ffi.pycapsule`, and the version of XLA's interface that it speaks.
#[pyfunction]
pub fn xla_handler() -> PyResult<(usize, [c_int; 2])> {
    let chosen = chosen_instruction_set()?;
    INSTRUCTION_SET.get_or_init(|| chosen);
    Ok((handle as *const () as usize, VERSION))
}

/// Numbers of a record beside its splines: step, displacement and velocity at the end, and the two of [`Severity`].
pub fn facts_of(history: &LoadingHistory<'_>) -> [f64; 5] {
    let (last, severity) = (history.last(), history.severity());
    [history.dt(), last.displacement, last.velocity, severity.peak_velocity, severity.reversal_acceleration]
}

/// Simulates the batch of a call, into the buffers of its results.
fn simulate(call: &mut Call<'_>) -> Result<(), String> {
    let damper = find(call.model).ok_or_else(|| format!("there is no damper model {:?}", call.model))?;
    let laws = if call.laws.is_empty() {
        CurrentLaws::constant(damper.spec())
    } else {
        let laws: Result<_, _> = call.laws.split('\n').map(CurrentLaw::of_name).collect();
        let lag = Lag::with_rates(call.rates).ok_or_else(|| in_words(DynamicsError::LagRates(call.rates)))?;
        laws.and_then(|laws| CurrentLaws::new(damper.spec(), laws, lag)).map_err(in_words)?
    };
    let n_columns = laws.n_columns();
    let [theta, coefficients, facts, command] = &call.operands;
    let n_time = call.force.row;
    if theta.row != n_columns || facts.row != 5 || coefficients.row != 8 * n_time.saturating_sub(1) {
        return Err(format!("the operands have rows of {:?} numbers", call.operands.map(|each| each.row)));
    }
    let columns: Vec<usize> =
        call.columns.iter().filter_map(|&column| usize::try_from(column).ok()).collect();
    let settings = Settings {
        step_factor: 1,
        threads: usize::try_from(call.threads).unwrap_or(1),
        instruction_set: *INSTRUCTION_SET.get().ok_or("the handler was not asked for by xla_handler")?,
        stop: &|| false,
    };
    let n_batch = call.force.leading.iter().product::<usize>();
    let places = [theta, coefficients, facts, command].map(|operand| operand.rows_for(&call.force.leading));
    let mut first = 0;
    while first < n_batch {
        let record = |row: usize| [places[1][row], places[2][row], places[3][row]];
        let end = (first + 1..n_batch).find(|&row| record(row) != record(first)).unwrap_or(n_batch);
        let [spline, fact, held] = record(first);
        let &[dt, displacement, velocity, peak_velocity, reversal_acceleration] = facts.at(fact) else {
            return Err("a record has five numbers beside its splines".to_owned());
        };
        let mut loading = LoadingHistory::from_parts(
            dt,
            Cow::Borrowed(coefficients.at(spline).as_chunks().0),
            Motion { displacement, velocity },
            Severity { peak_velocity, reversal_acceleration },
        );
        match *command.at(held) {
            [value] if value.is_nan() => {}
            [value] => loading = loading.with_command(&vec![value; n_time]).map_err(in_words)?,
            ref values => loading = loading.with_command(values).map_err(in_words)?,
        }
        if call.substeps != 0 {
            let substeps = u32::try_from(call.substeps).unwrap_or(u32::MAX);
            loading = loading.with_substeps(substeps).map_err(in_words)?;
        }
        let theta = theta.rows(&places[0][first..end]);
        let force = &mut call.force.values[first * n_time..end * n_time];
        let Some(jacobian) = &mut call.jacobian else {
            force_histories(damper, &laws, &theta, &loading, force, settings).map_err(in_words)?;
            first = end;
            continue;
        };
        let size = columns.len() * n_time;
        let jacobian = &mut jacobian.values[first * size..end * size];
        let rows = sensitivities(damper, &laws, &theta, &columns, &loading, force, jacobian, settings)
            .map_err(in_words)?;
        for (row, derivatives) in rows.iter().zip(jacobian.chunks_mut(size.max(1))) {
            if row.outcome != Outcome::Finished {
                derivatives.fill(0.0);
            }
        }
        first = end;
    }
    Ok(())
}

#[allow(clippy::needless_pass_by_value)] // maps an error
fn in_words(error: mrwork_dynamics::error::DynamicsError) -> String {
    error.to_string()
}

/// A call, checked: theta (..., `n_columns`), splines (..., `n_time` - 1, 8), facts (..., 5) and command (..., 1 or `n_time`)
/// of records, with leading axes of length 1 where they do not vary; force (..., `n_time`), and derivatives
/// (..., `n_asked`, `n_time`) if they are asked for. Derivatives of rows that failed are zero.
struct Call<'a> {
    operands: [Operand<'a>; 4],
    force: Output<'a>,
    jacobian: Option<Output<'a>>,
    model: &'a str,
    /// Current laws by name, a line each; empty for constant parameters.
    laws: &'a str,
    /// Rates of the driver's lag.
    rates: usize,
    columns: &'a [i64],
    /// Sub-steps of every candidate, 0 for those of the stepping rule.
    substeps: i64,
    threads: i64,
}

/// A batch of rows: leading axes, and the length of a row.
#[derive(Clone, Copy)]
struct Operand<'a> {
    values: &'a [f64],
    leading: &'a [i64],
    row: usize,
}

impl<'a> Operand<'a> {
    /// The row that goes with each row of a result with these leading axes.
    fn rows_for(&self, leading: &[usize]) -> Vec<usize> {
        let mut rows = vec![0];
        for (&own, &length) in self.leading.iter().zip(leading) {
            let step = |row: usize, index: usize| if own == 1 { row } else { row * length + index };
            rows = rows.iter().flat_map(|&row| (0..length).map(move |index| step(row, index))).collect();
        }
        rows
    }

    fn at(&self, row: usize) -> &'a [f64] {
        &self.values[row * self.row..][..self.row]
    }

    /// These rows one after the other; without a copy where they are.
    fn rows(&self, rows: &[usize]) -> Cow<'a, [f64]> {
        if rows.windows(2).all(|pair| pair[1] == pair[0] + 1) {
            return Cow::Borrowed(&self.values[rows[0] * self.row..][..rows.len() * self.row]);
        }
        Cow::Owned(rows.iter().flat_map(|&row| self.at(row)).copied().collect())
    }
}

/// A result: its numbers, leading axes, and the length of a row.
struct Output<'a> {
    values: &'a mut [f64],
    leading: Vec<usize>,
    row: usize,
}

/// The handler that XLA calls. It never unwinds, and leaves the state of the processor as it was.
extern "C" fn handle(frame: *mut CallFrame) -> *mut c_void {
    // SAFETY: XLA hands over a valid frame, whose extensions are a list that ends in a null pointer.
    let frame = unsafe { &*frame };
    // SAFETY: as above.
    if unsafe { answer_metadata(frame.extension_start) } {
        return ptr::null_mut();
    }
    let environment = FloatEnvironment::of_process();
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        // SAFETY: the buffers of a frame are valid and unshared until the handler returns.
        let mut call = unsafe { Call::read(frame) }?;
        simulate(&mut call)
    }));
    drop(environment);
    let (code, sentence) = match outcome {
        Ok(Ok(())) => return ptr::null_mut(),
        Ok(Err(sentence)) => (INVALID_ARGUMENT, sentence),
        Err(_) => {
            (INTERNAL, "a simulation panicked, which is a defect of mrwork; please report it".to_owned())
        }
    };
    let message = CString::new(format!("mrwork: {sentence}")).unwrap_or_default();
    let mut arguments = ErrorArguments {
        struct_size: size_of::<ErrorArguments>(),
        extension_start: ptr::null_mut(),
        message: message.as_ptr(),
        code,
    };
    // SAFETY: the table of functions is XLA's own, and the message, which it copies, outlives the call.
    unsafe { ((*frame.api).error_create)(&raw mut arguments) }
}

/// Answers the question for the version, if one of the extensions asks it.
///
/// # Safety
/// The extensions must be a valid list that ends in a null pointer.
unsafe fn answer_metadata(mut extension: *mut Extension) -> bool {
    // SAFETY: by the contract every pointer that is not null is a valid extension.
    while let Some(found) = unsafe { extension.as_ref() } {
        if found.kind == METADATA {
            // SAFETY: an extension of this kind begins a `MetadataExtension`, and XLA waits for what is written.
            unsafe {
                let metadata = (*extension.cast::<MetadataExtension>()).metadata;
                (*metadata).major_version = VERSION[0];
                (*metadata).minor_version = VERSION[1];
                (*metadata).traits = 0;
            }
            return true;
        }
        extension = found.next;
    }
    false
}

impl<'a> Call<'a> {
    /// Reads a frame.
    ///
    /// # Safety
    /// Its pointers and lengths must be those of valid buffers, which no one else uses while the call lives.
    unsafe fn read(frame: &'a CallFrame) -> Result<Self, String> {
        if frame.struct_size < offset_of!(CallFrame, attributes) + size_of::<Attributes>() {
            return Err("this XLA speaks an interface before 0.3; install jax 0.10".to_owned());
        }
        // SAFETY: by the contract, for each of the slices and buffers below.
        unsafe {
            let operands = slice(frame.arguments.entries, frame.arguments.size)?;
            let &[theta, coefficients, facts, command] = operands else {
                return Err(format!("there are {} operands; 4 are expected", operands.len()));
            };
            let (force, jacobian) = match slice(frame.results.entries, frame.results.size)? {
                &[force] => (force, None),
                &[force, jacobian] => (force, Some(jacobian)),
                results => return Err(format!("there are {} results; 1 or 2 are expected", results.len())),
            };
            let attributes = &frame.attributes;
            let call = Self {
                operands: [
                    operand(theta, 1)?,
                    operand(coefficients, 2)?,
                    operand(facts, 1)?,
                    operand(command, 1)?,
                ],
                force: output(force, 1)?,
                jacobian: jacobian.map(|buffer| output(buffer, 2)).transpose()?,
                model: text(attributes.find("model", STRING)?)?,
                laws: text(attributes.find("laws", STRING)?)?,
                rates: usize::try_from(scalar(attributes.find("rates", SCALAR)?)?).unwrap_or(usize::MAX),
                columns: integers(attributes.find("columns", ARRAY)?)?,
                substeps: scalar(attributes.find("substeps", SCALAR)?)?,
                threads: scalar(attributes.find("threads", SCALAR)?)?,
            };
            call.check_axes()?;
            Ok(call)
        }
    }

    fn check_axes(&self) -> Result<(), String> {
        let leading = &self.force.leading;
        for operand in &self.operands {
            let fits = |(&own, &length): (&i64, &usize)| own == 1 || usize::try_from(own) == Ok(length);
            if operand.leading.len() != leading.len() || !operand.leading.iter().zip(leading).all(fits) {
                return Err(format!(
                    "an operand has the leading axes {:?}, results {leading:?}",
                    operand.leading
                ));
            }
        }
        match &self.jacobian {
            Some(own) if own.leading != *leading || own.row != self.columns.len() * self.force.row => {
                Err("force and derivatives differ in shape".to_owned())
            }
            _ => Ok(()),
        }
    }
}

/// A slice of that many entries; XLA gives empty ones a null pointer.
///
/// # Safety
/// The pointer must be that of so many valid entries, for as long as the slice lives.
unsafe fn slice<'a, T>(data: *const T, size: i64) -> Result<&'a [T], String> {
    let size = usize::try_from(size).map_err(|_| format!("a length is {size}"))?;
    if size == 0 {
        return Ok(&[]);
    }
    if data.is_null() || !data.is_aligned() {
        return Err("a buffer is missing or not aligned".to_owned());
    }
    // SAFETY: by the contract; the pointer is aligned and not null.
    Ok(unsafe { std::slice::from_raw_parts(data, size) })
}

/// Leading axes of a buffer of 64-bit floats, its last axes as one row, and all its numbers.
///
/// # Safety
/// As for [`slice`].
unsafe fn axes<'a>(buffer: *const Buffer, n_row_axes: usize) -> Result<(&'a [i64], usize, i64), String> {
    // SAFETY: by the contract.
    let (buffer, dims) = unsafe { (&*buffer, slice((*buffer).dims, (*buffer).rank)?) };
    if buffer.data_type != F64 {
        return Err(format!("an operand has the data type {}; 64-bit floats are expected", buffer.data_type));
    }
    let (leading, row) =
        dims.split_at_checked(dims.len().wrapping_sub(n_row_axes)).ok_or("an operand has too few axes")?;
    let row = row.iter().map(|&length| usize::try_from(length).unwrap_or(0)).product();
    Ok((leading, row, dims.iter().product()))
}

/// # Safety
/// As for [`slice`].
unsafe fn operand<'a>(buffer: *const Buffer, n_row_axes: usize) -> Result<Operand<'a>, String> {
    // SAFETY: by the contract.
    unsafe {
        let (leading, row, size) = axes(buffer, n_row_axes)?;
        Ok(Operand { values: slice((*buffer).data.cast(), size)?, leading, row })
    }
}

/// # Safety
/// As for [`slice`], and nothing else may use the buffer.
unsafe fn output<'a>(buffer: *const Buffer, n_row_axes: usize) -> Result<Output<'a>, String> {
    // SAFETY: by the contract; the numbers are set before they are borrowed, because XLA leaves them undefined.
    unsafe {
        let (leading, row, size) = axes(buffer, n_row_axes)?;
        let data: *mut f64 = (*buffer).data.cast();
        let size = usize::try_from(size).map_err(|_| format!("a length is {size}"))?;
        let values = if size == 0 {
            &mut []
        } else if data.is_null() || !data.is_aligned() {
            return Err("a result is missing or not aligned".to_owned());
        } else {
            ptr::write_bytes(data, 0, size);
            std::slice::from_raw_parts_mut(data, size)
        };
        let leading = leading.iter().map(|&length| usize::try_from(length).unwrap_or(0)).collect();
        Ok(Output { values, leading, row })
    }
}

/// # Safety
/// The pointer must be that of a byte span.
unsafe fn text<'a>(attribute: *const c_void) -> Result<&'a str, String> {
    // SAFETY: by the contract.
    let bytes = unsafe {
        let span = &*attribute.cast::<ByteSpan>();
        slice(span.data, i64::try_from(span.length).unwrap_or(-1))?
    };
    std::str::from_utf8(bytes).map_err(|_| "an attribute is no text".to_owned())
}

/// # Safety
/// The pointer must be that of a scalar.
unsafe fn scalar(attribute: *const c_void) -> Result<i64, String> {
    // SAFETY: by the contract; an `S64` has eight bytes.
    unsafe {
        let scalar = &*attribute.cast::<Scalar>();
        if scalar.data_type != S64 {
            return Err(format!(
                "an attribute has the data type {}; 64-bit integers are expected",
                scalar.data_type
            ));
        }
        Ok(scalar.value.cast::<i64>().read_unaligned())
    }
}

/// # Safety
/// The pointer must be that of an array.
unsafe fn integers<'a>(attribute: *const c_void) -> Result<&'a [i64], String> {
    // SAFETY: by the contract.
    unsafe {
        let array = &*attribute.cast::<Array>();
        if array.data_type != S64 {
            return Err(format!(
                "an attribute has the data type {}; 64-bit integers are expected",
                array.data_type
            ));
        }
        slice(array.data.cast(), i64::try_from(array.size).unwrap_or(-1))
    }
}

impl Attributes {
    /// The attribute of that name and kind.
    ///
    /// # Safety
    /// The attributes must be valid.
    unsafe fn find(&self, name: &str, kind: c_int) -> Result<*const c_void, String> {
        // SAFETY: by the contract; the three lists have the same length.
        unsafe {
            let names = slice(self.names, self.size)?;
            let (kinds, values) = (slice(self.kinds, self.size)?, slice(self.values, self.size)?);
            for ((&own, &of), &value) in names.iter().zip(kinds).zip(values) {
                if text(own.cast())? == name && of == kind {
                    return Ok(value);
                }
            }
        }
        Err(format!("the attribute {name} is missing"))
    }
}

/// The control word of the floating-point unit that the thread had, which is restored when this is dropped.
///
/// Between the two, numbers are rounded to nearest, and subnormal numbers are kept, as everywhere else in the process.
struct FloatEnvironment(u64);

impl FloatEnvironment {
    fn of_process() -> Self {
        let before = Self(control_word());
        set_control_word(PROCESS_CONTROL_WORD);
        before
    }
}

impl Drop for FloatEnvironment {
    fn drop(&mut self) {
        set_control_word(self.0);
    }
}

/// The word with which threads begin: all exceptions masked on x86, nothing set on others.
const PROCESS_CONTROL_WORD: u64 = if cfg!(target_arch = "x86_64") { 0x1F80 } else { 0 };

#[cfg(target_arch = "x86_64")]
fn control_word() -> u64 {
    let mut word = 0_u32;
    // SAFETY: stores the control word to a variable of its size.
    unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut word, options(nostack, preserves_flags)) };
    u64::from(word)
}

#[cfg(target_arch = "x86_64")]
fn set_control_word(word: u64) {
    #[allow(clippy::cast_possible_truncation)] // the upper half is zero
    let word = word as u32;
    // SAFETY: loads a word that was stored, or that of a new thread.
    unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const word, options(nostack, preserves_flags)) };
}

#[cfg(target_arch = "aarch64")]
fn control_word() -> u64 {
    let word: u64;
    // SAFETY: reads a register that every program may read.
    unsafe { std::arch::asm!("mrs {}, fpcr", out(reg) word, options(nomem, nostack, preserves_flags)) };
    word
}

#[cfg(target_arch = "aarch64")]
fn set_control_word(word: u64) {
    // SAFETY: writes a word that was read, or that of a new thread.
    unsafe { std::arch::asm!("msr fpcr, {}", in(reg) word, options(nostack, preserves_flags)) };
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn control_word() -> u64 {
    0
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn set_control_word(_: u64) {}

const INVALID_ARGUMENT: c_int = 3;
const INTERNAL: c_int = 13;
const METADATA: c_int = 1;
const F64: c_int = 12;
const S64: c_int = 5;
const ARRAY: c_int = 1;
const SCALAR: c_int = 3;
const STRING: c_int = 4;

#[repr(C)]
struct Extension {
    struct_size: usize,
    kind: c_int,
    next: *mut Extension,
}

#[repr(C)]
struct MetadataExtension {
    base: Extension,
    metadata: *mut Metadata,
}

/// `XLA_FFI_Metadata`, with the fields of its `XLA_FFI_Api_Version` in their place.
#[repr(C)]
struct Metadata {
    struct_size: usize,
    version_size: usize,
    version_extension: *mut Extension,
    major_version: c_int,
    minor_version: c_int,
    traits: u32,
}

/// `XLA_FFI_Api` up to the one function that is called.
#[repr(C)]
struct Api {
    struct_size: usize,
    extension_start: *mut Extension,
    version_size: usize,
    version_extension: *mut Extension,
    major_version: c_int,
    minor_version: c_int,
    internal: *const c_void,
    error_create: unsafe extern "C" fn(*mut ErrorArguments) -> *mut c_void,
}

#[repr(C)]
struct ErrorArguments {
    struct_size: usize,
    extension_start: *mut Extension,
    message: *const c_char,
    code: c_int,
}

#[repr(C)]
struct CallFrame {
    struct_size: usize,
    extension_start: *mut Extension,
    api: *const Api,
    context: *mut c_void,
    stage: c_int,
    arguments: Buffers,
    results: Buffers,
    attributes: Attributes,
}

/// `XLA_FFI_Args` and `XLA_FFI_Rets`, all of whose entries are buffers.
#[repr(C)]
struct Buffers {
    struct_size: usize,
    extension_start: *mut Extension,
    size: i64,
    kinds: *const c_int,
    entries: *const *const Buffer,
}

#[repr(C)]
struct Attributes {
    struct_size: usize,
    extension_start: *mut Extension,
    size: i64,
    kinds: *const c_int,
    names: *const *const ByteSpan,
    values: *const *const c_void,
}

#[repr(C)]
struct Buffer {
    struct_size: usize,
    extension_start: *mut Extension,
    data_type: c_int,
    data: *mut c_void,
    rank: i64,
    dims: *const i64,
}

#[repr(C)]
struct ByteSpan {
    data: *const u8,
    length: usize,
}

#[repr(C)]
struct Scalar {
    data_type: c_int,
    value: *const c_void,
}

#[repr(C)]
struct Array {
    data_type: c_int,
    size: usize,
    data: *const c_void,
}
