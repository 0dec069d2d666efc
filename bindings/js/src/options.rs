//! JavaScript objects as options of the engine.

use js_sys::{Array, Float32Array, Object, Uint8Array};
use lodsmith::OwnedMeshData;
#[cfg(not(feature = "formats"))]
use lodsmith::SimplifyOptions;
#[cfg(not(feature = "formats"))]
use lodsmith::options::by_name::{self, OptionValue};
#[cfg(feature = "formats")]
use lodsmith_asset::request::{JobOption, Verb};
#[cfg(feature = "formats")]
use serde_json::Value;
use wasm_bindgen::prelude::*;

#[cfg(not(feature = "formats"))]
use crate::errors::{camel_case, option_error, wrong_value};
use crate::errors::{dashed, wrong_type};
#[cfg(not(feature = "formats"))]
use crate::report::object;

/// A property of an object: its name and its value.
pub(crate) type Property = (String, JsValue);

/// An owned value of an option.
enum Given {
    Flag(bool),
    Whole(u64),
    Number(f64),
    Text(String),
    Weights(Vec<(String, f64)>),
}

/// The largest whole number up to which doubles represent all exactly.
const MAX_WHOLE: f64 = 9_007_199_254_740_991.0;

impl Given {
    fn of(name: &str, any: &JsValue) -> Result<Self, JsValue> {
        if let Some(flag) = any.as_bool() {
            return Ok(Self::Flag(flag));
        }
        if let Some(text) = any.as_string() {
            return Ok(Self::Text(text));
        }
        if let Some(x) = any.as_f64() {
            let is_whole = x.fract() == 0.0 && (0.0..=MAX_WHOLE).contains(&x);
            return Ok(if is_whole { Self::Whole(x as u64) } else { Self::Number(x) });
        }
        let wrong = || wrong_type(&format!("{name}: the value has a wrong type"));
        if !any.is_object() || any.is_function() || Array::is_array(any) {
            return Err(wrong());
        }
        let mut all = Vec::new();
        for (name, value) in entries(any) {
            all.push((dashed(&name), value.as_f64().ok_or_else(wrong)?));
        }
        Ok(Self::Weights(all))
    }

    #[cfg(not(feature = "formats"))]
    fn value(&self) -> OptionValue<'_> {
        match self {
            Self::Flag(x) => OptionValue::Flag(*x),
            Self::Whole(x) => OptionValue::Whole(*x),
            Self::Number(x) => OptionValue::Number(*x),
            Self::Text(x) => x.as_str().into(),
            Self::Weights(all) => {
                OptionValue::Weights(all.iter().map(|(k, x)| (k.as_str().into(), *x)).collect())
            }
        }
    }
}

/// Returns the properties of an object that are neither `undefined` nor `null`.
pub(crate) fn entries(of: &JsValue) -> Vec<Property> {
    let Some(object) = of.dyn_ref::<Object>() else { return Vec::new() };
    let pair = |pair: JsValue| {
        let pair: Array = pair.dyn_into().ok()?;
        let (name, value) = (pair.get(0).as_string()?, pair.get(1));
        (!value.is_undefined() && !value.is_null()).then_some((name, value))
    };
    Object::entries(object).iter().filter_map(pair).collect()
}

/// Returns a property of an object, unless it is `undefined` or `null`.
#[cfg(not(feature = "formats"))]
pub(crate) fn property(of: &JsValue, name: &str) -> Option<JsValue> {
    let value = js_sys::Reflect::get(of, &name.into()).ok()?;
    (!value.is_undefined() && !value.is_null()).then_some(value)
}

/// Separates the data of vertices, of all meshes together, from the other properties of an object.
///
/// # Errors
/// If a list has the wrong type.
pub(crate) fn vertices_of(all: Vec<Property>) -> Result<(Option<OwnedMeshData>, Vec<Property>), JsValue> {
    let mut data = OwnedMeshData::default();
    let mut others = Vec::new();
    for (name, value) in all {
        match (name.as_str(), value.is_string()) {
            ("locked", _) => {
                let flags = value.dyn_ref::<Uint8Array>().map(Uint8Array::to_vec);
                let flags = flags.ok_or_else(|| wrong_type("locked: a Uint8Array is expected"))?;
                data.locked = Some(flags.iter().map(|x| *x != 0).collect());
            }
            // (A text is the name of an attribute.)
            ("importance", false) => {
                let factors = value.dyn_ref::<Float32Array>().map(Float32Array::to_vec);
                data.importance =
                    Some(factors.ok_or_else(|| wrong_type("importance: a Float32Array is expected"))?);
            }
            ("errorMap", false) => {
                let shares = value.dyn_ref::<Float32Array>().map(Float32Array::to_vec);
                data.error_map =
                    Some(shares.ok_or_else(|| wrong_type("errorMap: a Float32Array is expected"))?);
            }
            _ => others.push((name, value)),
        }
    }
    Ok(((data != OwnedMeshData::default()).then_some(data), others))
}

/// Converts a value of an option to JSON.
#[cfg(feature = "formats")]
pub(crate) fn json_of(name: &str, any: &JsValue) -> Result<Value, JsValue> {
    if Array::is_array(any) {
        let all: Array = any.clone().into();
        return all.iter().map(|item| json_of(name, &item)).collect::<Result<_, _>>().map(Value::Array);
    }
    Ok(match Given::of(name, any)? {
        Given::Flag(x) => x.into(),
        Given::Whole(x) => x.into(),
        Given::Number(x) => x.into(),
        Given::Text(x) => x.into(),
        Given::Weights(all) => Value::Object(all.into_iter().map(|(name, x)| (name, x.into())).collect()),
    })
}

/// Converts an object to options of the engine, and data of the vertices of all meshes together.
#[cfg(not(feature = "formats"))]
pub(crate) fn options_of(object: &JsValue) -> Result<(SimplifyOptions, OwnedMeshData), JsValue> {
    if !object.is_object() {
        return Err(wrong_type("an object of options is expected, such as { ratio: 0.1 }"));
    }
    let (data, others) = vertices_of(entries(object))?;
    let mut given = Vec::new();
    for (name, value) in others {
        given.push((dashed(&name), Given::of(&name, &value)?));
    }
    let given: Vec<_> = given.iter().map(|(name, value)| (name.as_str(), value.value())).collect();
    let options = by_name::from_names(&given).map_err(|e| option_error(&e))?;
    if !options.has_end() {
        let text = "give a target (faces, vertices, ratio, error) or an option that ends the method";
        return Err(wrong_value(text));
    }
    Ok((options, data.unwrap_or_default()))
}

/// Returns the table of the options: name, kind, words, default and help.
#[cfg(not(feature = "formats"))]
#[wasm_bindgen(js_name = optionTable)]
pub fn option_table() -> Array {
    let row = |option: &by_name::NamedOption| {
        let (kind, words) = (option.kind.name(), option.kind.words());
        object([
            ("name", camel_case(option.name).into()),
            ("kind", kind.into()),
            ("words", words.iter().map(|word| JsValue::from(*word)).collect::<Array>().into()),
            ("default", option.default_text().map_or(JsValue::NULL, JsValue::from)),
            ("help", option.help.into()),
        ])
    };
    by_name::OPTIONS.iter().map(row).collect()
}

/// Returns the table of the options of a file: name, kind, words, default and help, and whether it is a list.
#[cfg(feature = "formats")]
#[wasm_bindgen(js_name = optionTable)]
pub fn option_table() -> JsValue {
    let rows: Value = JobOption::all(Verb::Simplify).iter().map(JobOption::to_json).collect();
    js_sys::JSON::parse(&rows.to_string()).unwrap_or(JsValue::NULL)
}
