//! Conversion from and to NumPy arrays.

use crate::errors::{bad_type, bad_value};
use numpy::ndarray::{ArrayView, Dimension, IntoDimension};
use numpy::{
    Element, PyArray, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple, PyType};
use vg::geometry::{Pose, Similarity};

/// `object` as an array of `T` in row order, copied only if it lies in memory differently. The error names
/// `argument`, what was found, and what is `allowed`.
pub(crate) fn array<'py, T: Element>(
    object: &Bound<'py, PyAny>,
    argument: &str,
    allowed: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let py = object.py();
    let numpy = py.import("numpy")?;
    let found = || object.get_type().name().map_or_else(|_| "an object".into(), |n| n.to_string());
    let any = numpy.call_method1("asarray", (object,)).map_err(|_| bad_type(argument, &found(), allowed))?;
    let untyped = any.cast::<PyUntypedArray>()?;
    let dtype = untyped.dtype();
    if !dtype.is_equiv_to(&numpy::dtype::<T>(py)) {
        let is_array = object.is_instance_of::<PyUntypedArray>();
        let found = if is_array { format!("array of {dtype}") } else { found() };
        return Err(bad_type(argument, &found, allowed));
    }
    let aligned = || any.getattr("flags")?.getattr("aligned")?.is_truthy();
    let any = match untyped.is_c_contiguous() && aligned()? {
        true => any,
        false => numpy.call_method1("require", (any, py.None(), ["C", "A"]))?,
    };
    Ok(any.cast_into::<PyArray<T, _>>()?.try_readonly()?)
}

/// `object` as an array of float32. Floats of any precision are rounded. Whole numbers are accepted in a list but not
/// in an array, where they often have another unit.
pub(crate) fn floats<'py>(
    object: &Bound<'py, PyAny>,
    argument: &str,
    allowed: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    let py = object.py();
    let numpy = py.import("numpy")?;
    if let Ok(any) = numpy.call_method1("asarray", (object,)) {
        let kind = any.cast::<PyUntypedArray>()?.dtype().kind();
        let is_list = object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>();
        if kind == b'f' || (is_list && matches!(kind, b'i' | b'u')) {
            return array(&numpy.call_method1("asarray", (any, "float32"))?, argument, allowed);
        }
    }
    array(object, argument, allowed)
}

/// The numbers of an array in row order.
pub(crate) fn values<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<&'a [T]> {
    Ok(array.as_slice()?)
}

/// A shape in Python's notation.
pub(crate) fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("shape ({one},)"),
        _ => format!("shape ({})", shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// Any object that NumPy converts to float64, and its shape.
pub(crate) fn numbers(
    object: &Bound<'_, PyAny>,
    argument: &str,
    allowed: &str,
) -> PyResult<(Vec<usize>, Vec<f64>)> {
    let py = object.py();
    let found = || object.get_type().name().map_or_else(|_| "an object".into(), |n| n.to_string());
    // NumPy would read text as numbers, and drop the imaginary part of complex ones.
    let is_real = |any: &Bound<'_, PyAny>| {
        any.cast::<PyUntypedArray>().is_ok_and(|array| b"biufO".contains(&array.dtype().kind()))
    };
    let numpy = py.import("numpy")?;
    let any = numpy.call_method1("asarray", (object,)).ok().filter(is_real);
    let any = any.and_then(|any| numpy.call_method1("asarray", (any, "float64")).ok());
    let any = any.ok_or_else(|| bad_type(argument, &found(), allowed))?;
    let array = array::<f64>(&any, argument, allowed)?;
    Ok((array.shape().to_vec(), values(&array)?.to_vec()))
}

/// A list of `N` numbers.
pub(crate) fn vector<const N: usize>(object: &Bound<'_, PyAny>, argument: &str) -> PyResult<[f64; N]> {
    let allowed = format!("{N} numbers");
    let (shape, values) = numbers(object, argument, &allowed)?;
    if shape != [N] {
        return Err(bad_value(object.py(), argument, &shape_text(&shape), &allowed));
    }
    Ok(std::array::from_fn(|i| values[i]))
}

/// Rows of `N` numbers.
pub(crate) fn rows<const N: usize>(object: &Bound<'_, PyAny>, argument: &str) -> PyResult<Vec<[f64; N]>> {
    let allowed = format!("an (n, {N}) array");
    let (shape, values) = numbers(object, argument, &allowed)?;
    match shape[..] {
        [_, n] if n == N => Ok(values.as_chunks::<N>().0.to_vec()),
        _ => Err(bad_value(object.py(), argument, &shape_text(&shape), &allowed)),
    }
}

/// A 3x3 matrix, row-major.
pub(crate) fn matrix3(object: &Bound<'_, PyAny>, argument: &str) -> PyResult<[f64; 9]> {
    let allowed = "a 3x3 matrix";
    let (shape, values) = numbers(object, argument, allowed)?;
    if shape != [3, 3] {
        return Err(bad_value(object.py(), argument, &shape_text(&shape), allowed));
    }
    Ok(std::array::from_fn(|i| values[i]))
}

/// A rigid transform as a 3x4 or 4x4 matrix.
pub(crate) fn pose(object: &Bound<'_, PyAny>, argument: &str) -> PyResult<Pose> {
    let rows = pose_rows(object, argument)?;
    Pose::from_row_major(argument, &rows).map_err(|e| crate::errors::from_library(object.py(), e))
}

/// The upper three rows of a 3x4 or 4x4 matrix.
pub(crate) fn pose_rows(object: &Bound<'_, PyAny>, argument: &str) -> PyResult<[f64; 12]> {
    let py = object.py();
    let allowed = "a 3x4 or 4x4 matrix";
    let (shape, values) = numbers(object, argument, allowed)?;
    match shape[..] {
        [3, 4] => {}
        [4, 4] if values[12..] == [0.0, 0.0, 0.0, 1.0] => {}
        [4, 4] => {
            return Err(bad_value(py, argument, &format!("last row {:?}", &values[12..]), "0 0 0 1"));
        }
        _ => return Err(bad_value(py, argument, &shape_text(&shape), allowed)),
    }
    Ok(std::array::from_fn(|i| values[i]))
}

/// A similarity as a 4x4 matrix.
pub(crate) fn similarity(object: &Bound<'_, PyAny>, argument: &str) -> PyResult<Similarity> {
    let py = object.py();
    let allowed = "a 4x4 matrix";
    let (shape, values) = numbers(object, argument, allowed)?;
    if shape != [4, 4] {
        return Err(bad_value(py, argument, &shape_text(&shape), allowed));
    }
    let m = std::array::from_fn(|i| values[i]);
    Similarity::from_row_major(argument, &m).map_err(|e| crate::errors::from_library(py, e))
}

/// A new array that takes over the memory of `values`.
pub(crate) fn owned<T: Element, D: IntoDimension>(
    py: Python<'_>,
    shape: D,
    values: Vec<T>,
) -> Bound<'_, PyArray<T, D::Dim>>
where
    D::Dim: Dimension,
{
    let array = numpy::ndarray::Array::from_shape_vec(shape.into_dimension(), values);
    PyArray::from_owned_array(py, array.expect("as many values as the shape has places"))
}

/// A 4x4 matrix.
pub(crate) fn matrix4<'py>(py: Python<'py>, rows: &[f64]) -> Bound<'py, PyArray<f64, numpy::Ix2>> {
    let mut m = rows.to_vec();
    if m.len() == 12 {
        m.extend([0.0, 0.0, 0.0, 1.0]);
    }
    owned(py, (4, 4), m)
}

/// A `vehicle_gaussians._frozen.FrozenArray` over memory of `owner`, which it keeps alive.
///
/// # Safety
/// `view` must point to memory that does not move or change as long as `owner` lives.
#[expect(unsafe_code)]
pub(crate) unsafe fn borrowed<'py, T: Element, D: Dimension>(
    owner: Bound<'py, PyAny>,
    view: &ArrayView<'_, T, D>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let class = CLASS.import(owner.py(), "vehicle_gaussians._frozen", "FrozenArray")?.clone();
    // SAFETY: required of the caller.
    let array = unsafe { PyArray::borrow_from_array(view, owner) };
    // Python cannot set the flag again: the array does not own its memory, and its owner is not writable.
    let array = array.readwrite().make_nonwriteable();
    Ok(array.call_method1("view", (class,))?.cast_into()?)
}
