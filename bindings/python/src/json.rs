//! Conversion of JSON values to Python types, and back.

use std::path::PathBuf;

use lodsmith_asset::request::{FileOptions, Request, Verb};
use lodsmith_asset::warnings::Spelling;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyList, PyMapping};
use serde_json::{Map, Number, Value};

use crate::errors::asset_error;

/// Converts a JSON value to Python types.
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

/// Converts options to JSON.
pub(crate) fn options_of_python(given: &Bound<'_, PyDict>) -> PyResult<Map<String, Value>> {
    let one = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let name: String = name.extract()?;
        let wrong =
            |_| PyValueError::new_err(format!("{name}: a value of type {} is not taken", value.get_type()));
        let value = of_python(&value).map_err(wrong)?;
        Ok((name, value))
    };
    given.iter().map(one).collect()
}

/// Reads the options of a job by name; those that are not given have their defaults.
pub(crate) fn options_of_job(verb: Verb, given: &Bound<'_, PyDict>) -> PyResult<FileOptions> {
    let request = Request::new(verb, &options_of_python(given)?, Spelling::Keyword);
    Ok(request.map_err(|e| asset_error(&e))?.options().clone())
}

/// Converts a value of a Python type, a NumPy value or a path to JSON.
fn of_python(any: &Bound<'_, PyAny>) -> PyResult<Value> {
    Ok(if any.is_none() {
        Value::Null
    } else if let Ok(x) = any.extract::<bool>() {
        x.into()
    } else if let Ok(text) = any.extract::<String>() {
        text.into()
    } else if let Ok(mapping) = any.cast::<PyMapping>() {
        let pair = |item: Bound<'_, PyAny>| {
            let (key, value): (String, Bound<'_, PyAny>) = item.extract()?;
            Ok((key, of_python(&value)?))
        };
        Value::Object(mapping.items()?.iter().map(pair).collect::<PyResult<_>>()?)
    } else if !any.is_instance_of::<PyFloat>()
        && let Ok(n) = any.extract::<u64>()
    {
        n.into()
    } else if let Ok(x) = any.extract::<f64>() {
        // JSON has no NaN: as a text, it is an invalid value for every option.
        Number::from_f64(x).map_or_else(|| x.to_string().into(), Value::Number)
    } else if let Ok(path) = any.extract::<PathBuf>() {
        path.to_string_lossy().into()
    } else {
        Value::Array(any.try_iter()?.map(|item| of_python(&item?)).collect::<PyResult<_>>()?)
    })
}
