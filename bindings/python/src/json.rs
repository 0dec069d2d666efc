//! JSON values as Python's own types.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyList, PyString, PyTuple};
use serde_json::Value;

/// Converts a JSON value to Python's own types.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Null => py.None().into_bound(py),
        Value::Bool(x) => x.into_pyobject(py)?.to_owned().into_any(),
        Value::Number(x) => match (x.as_u64(), x.as_i64(), x.as_f64()) {
            (Some(x), ..) => x.into_pyobject(py)?.into_any(),
            (_, Some(x), _) => x.into_pyobject(py)?.into_any(),
            (.., x) => x.unwrap_or(f64::NAN).into_pyobject(py)?.into_any(),
        },
        Value::String(x) => x.into_pyobject(py)?.into_any(),
        Value::Array(all) => {
            let list = PyList::empty(py);
            all.iter().try_for_each(|x| list.append(to_python(py, x)?))?;
            list.into_any()
        }
        Value::Object(all) => {
            let dict = PyDict::new(py);
            all.iter().try_for_each(|(k, x)| dict.set_item(k, to_python(py, x)?))?;
            dict.into_any()
        }
    })
}

/// Converts a value of Python's own types, of NumPy, or a path to JSON.
pub(crate) fn of_python(any: &Bound<'_, PyAny>) -> PyResult<Value> {
    Ok(if any.is_none() {
        Value::Null
    } else if any.is_instance_of::<PyBool>() {
        Value::Bool(any.extract()?)
    } else if any.is_instance_of::<PyString>() {
        Value::String(any.extract()?)
    } else if let Ok(dict) = any.cast::<PyDict>() {
        let pair = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            Ok((key.extract::<String>()?, of_python(&value)?))
        };
        Value::Object(dict.iter().map(pair).collect::<PyResult<_>>()?)
    } else if any.is_instance_of::<PyList>() || any.is_instance_of::<PyTuple>() {
        Value::Array(any.try_iter()?.map(|item| of_python(&item?)).collect::<PyResult<_>>()?)
    } else if !any.is_instance_of::<PyFloat>()
        && let Ok(n) = any.extract::<u64>()
    {
        n.into()
    } else if let Ok(x) = any.extract::<f64>() {
        x.into()
    } else {
        Value::String(any.extract::<PathBuf>()?.to_string_lossy().into_owned())
    })
}
