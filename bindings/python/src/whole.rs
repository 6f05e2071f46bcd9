//! Whole numbers among the arguments: one that is negative or too large is an error that names it.

use crate::errors::{bad_type, bad_value};
use pyo3::prelude::*;

/// `threads`, of every call that works on several.
pub(crate) fn threads(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    whole(object, "threads", "0 (all cores) to 1024")
}

/// `sh_degree`.
pub(crate) fn sh_degree(object: &Bound<'_, PyAny>) -> PyResult<u8> {
    whole(object, "sh_degree", "0 to 3")
}

/// `width` of a camera.
pub(crate) fn width(object: &Bound<'_, PyAny>) -> PyResult<u32> {
    whole(object, "width", "1 to 8192")
}

/// `height` of a camera.
pub(crate) fn height(object: &Bound<'_, PyAny>) -> PyResult<u32> {
    whole(object, "height", "1 to 8192")
}

/// The first column of a part of a picture.
pub(crate) fn x(object: &Bound<'_, PyAny>) -> PyResult<u32> {
    whole(object, "x", "a column of the picture, 0 or above")
}

/// The first row of a part of a picture.
pub(crate) fn y(object: &Bound<'_, PyAny>) -> PyResult<u32> {
    whole(object, "y", "a row of the picture, 0 or above")
}

/// How many cameras of a turntable.
pub(crate) fn count(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    whole(object, "count", "1 to 100000")
}

/// `iterations` of a refinement, or None.
pub(crate) fn iterations(object: &Bound<'_, PyAny>) -> PyResult<Option<u32>> {
    given(object, |object| whole(object, "iterations", "1 to 1000000"))
}

/// `refine_iterations`, or None.
pub(crate) fn refine_iterations(object: &Bound<'_, PyAny>) -> PyResult<Option<u32>> {
    given(object, |object| whole(object, "refine_iterations", "1 to 1000000"))
}

fn given<'py, T>(
    object: &Bound<'py, PyAny>,
    parse: impl FnOnce(&Bound<'py, PyAny>) -> PyResult<T>,
) -> PyResult<Option<T>> {
    if object.is_none() { Ok(None) } else { parse(object).map(Some) }
}

/// A whole number of any argument.
pub(crate) fn whole<T: TryFrom<u64>>(
    object: &Bound<'_, PyAny>,
    argument: &str,
    allowed: &str,
) -> PyResult<T> {
    if let Some(number) = object.extract::<u64>().ok().and_then(|number| T::try_from(number).ok()) {
        return Ok(number);
    }
    let py = object.py();
    match py.import("operator")?.call_method1("index", (object,)) {
        Ok(number) => Err(bad_value(py, argument, &number.str()?.to_string(), allowed)),
        Err(_) => {
            let found = object.get_type().name()?.to_string();
            Err(bad_type(argument, &found, &format!("a whole number, {allowed}")))
        }
    }
}
