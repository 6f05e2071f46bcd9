//! Options of a reconstruction that are in the library's table, `Options::fields`: from a dictionary.

use crate::errors::{bad_type, from_library};
use crate::whole::whole;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use vg::geometry::options::{Face, Field, Kind, Value, check};
use vg::pipeline::Options;

/// The options of a dictionary, by their names in Python; those that it does not have are the default.
pub(crate) fn options(given: &Bound<'_, PyDict>) -> PyResult<Options> {
    let py = given.py();
    let mut options = Options::default();
    for field in Options::fields().iter().filter(|field| !field.facts.apart.contains(&Face::Python)) {
        let name = field.facts.short.unwrap_or(field.name);
        if let Some(object) = given.get_item(name)? {
            let value = value(&object, name, field)?;
            let checked = check(name, &value, &field.facts).and_then(|()| options.set(field.name, value));
            checked.map_err(|e| from_library(py, e))?;
        }
    }
    Ok(options)
}

fn value(object: &Bound<'_, PyAny>, name: &str, field: &Field) -> PyResult<Value> {
    let words = field.facts.range.map_or("0 or above", |range| range.words);
    match field.kind {
        Kind::MaybeWhole | Kind::MaybeReal if object.is_none() => Ok(Value::Absent),
        Kind::Whole | Kind::MaybeWhole => whole(object, name, words).map(Value::Whole),
        Kind::Real | Kind::MaybeReal => extracted(object, name, "a number").map(Value::Real),
        Kind::Flag => extracted(object, name, "True or False").map(Value::Flag),
        Kind::Choice(_) => extracted(object, name, &names(field).join(", ")).map(Value::Name),
        Kind::Set(_) => {
            let mut chosen: Vec<String> = extracted(object, name, "names")?;
            if chosen.iter().any(|name| name == ALL) {
                chosen = names(field).into_iter().filter(|name| name != ALL).collect();
            }
            Ok(Value::Names(chosen))
        }
    }
}

/// Everything of a set.
const ALL: &str = "all";

/// Names of the values that a field can have.
fn names(field: &Field) -> Vec<String> {
    let (Kind::Choice(enumeration) | Kind::Set(enumeration)) = field.kind else { return Vec::new() };
    enumeration().variants.iter().map(|variant| variant.name.to_owned()).collect()
}

fn extracted<'py, T: for<'a> FromPyObject<'a, 'py>>(
    object: &Bound<'py, PyAny>,
    name: &str,
    allowed: &str,
) -> PyResult<T> {
    object.extract().map_err(|_| match object.get_type().name() {
        Ok(found) => bad_type(name, &found.to_string(), allowed),
        Err(error) => error,
    })
}
