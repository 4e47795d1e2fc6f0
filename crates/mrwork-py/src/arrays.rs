//! Arrays at the boundary: shapes and memory layout are checked here, once, and refused in one sentence.

use numpy::ndarray::{Array, Dimension};
use numpy::{Element, PyReadonlyArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;

use crate::enter::SettingError;

/// An axis of an array: its name, and its length if it must have one.
pub type Axis = (&'static str, Option<usize>);

/// The elements of an array, row-major.
pub fn contiguous<'a, T: Element, D: Dimension>(
    name: &str,
    array: &'a PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    // `as_slice` refuses unaligned arrays, but accepts column-major ones, whose elements would be read as transposed.
    array.as_slice().ok().filter(|_| array.is_c_contiguous()).ok_or_else(|| {
        let kind = array.dtype();
        SettingError::new_err(format!("`{name}` must be C-contiguous {kind}; use numpy.ascontiguousarray"))
    })
}

/// The elements of an array of this shape, row-major.
pub fn shaped<'a, T: Element, D: Dimension>(
    name: &str,
    array: &'a PyReadonlyArray<'_, T, D>,
    axes: &[Axis],
) -> PyResult<&'a [T]> {
    with_shape(name, array.shape(), axes)?;
    contiguous(name, array)
}

/// Refuses an array of another shape.
pub fn with_shape(name: &str, shape: &[usize], axes: &[Axis]) -> PyResult<()> {
    let fits = |(&found, axis): (&usize, &Axis)| axis.1.is_none_or(|expected| found == expected);
    if shape.len() == axes.len() && shape.iter().zip(axes).all(fits) {
        return Ok(());
    }
    let expected: Vec<String> = axes
        .iter()
        .map(|&(axis, length)| length.map_or_else(|| axis.to_owned(), |length| format!("{axis} = {length}")))
        .collect();
    let found: Vec<String> = shape.iter().map(ToString::to_string).collect();
    Err(SettingError::new_err(format!(
        "`{name}` has shape ({}), expected ({}); give an array of that shape",
        found.join(", "),
        expected.join(", ")
    )))
}

/// A buffer of zeros for an array of this shape.
pub fn zeros(shape: &[usize]) -> PyResult<Vec<f64>> {
    let too_large = || PyMemoryError::new_err(format!("a result of shape {shape:?} does not fit in memory"));
    let length =
        shape.iter().try_fold(1_usize, |length, &axis| length.checked_mul(axis)).ok_or_else(too_large)?;
    let mut buffer = Vec::new();
    buffer.try_reserve_exact(length).map_err(|_| too_large())?;
    buffer.resize(length, 0.0);
    Ok(buffer)
}

/// An array of this shape with the elements of `buffer`.
pub fn array_of<D: Dimension>(shape: D, buffer: Vec<f64>) -> PyResult<Array<f64, D>> {
    Array::from_shape_vec(shape, buffer).map_err(|error| PyValueError::new_err(error.to_string()))
}
