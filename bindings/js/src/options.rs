//! Objects of JavaScript as options of the engine.

use js_sys::{Array, Float32Array, Object, Uint8Array};
use lodsmith::options::by_name::{self, OptionValue};
use lodsmith::{OwnedMeshData, SimplifyError, SimplifyOptions, Stop};
use wasm_bindgen::prelude::*;

#[cfg(not(feature = "formats"))]
use crate::errors::camel_case;
use crate::errors::{dashed, option_error, run_error, wrong_type, wrong_value};
#[cfg(not(feature = "formats"))]
use crate::report::object;

/// A value of an option, owned.
enum Given {
    Flag(bool),
    Whole(u64),
    Number(f64),
    Text(String),
    Weights(Vec<(String, f64)>),
}

/// The largest whole number up to which every one is a double.
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
        let wrong = || wrong_type(&format!("{name}: a value of this kind is not taken"));
        if !any.is_object() || any.is_function() || Array::is_array(any) {
            return Err(wrong());
        }
        let mut all = Vec::new();
        for (name, value) in entries(any) {
            all.push((dashed(&name), value.as_f64().ok_or_else(wrong)?));
        }
        Ok(Self::Weights(all))
    }

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

/// Returns the properties of an object, without those that are `undefined` or `null`.
pub(crate) fn entries(of: &JsValue) -> Vec<(String, JsValue)> {
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

/// Converts an object to options of the engine, and data of the vertices of all meshes together.
pub(crate) fn options_of(object: &JsValue) -> Result<(SimplifyOptions, OwnedMeshData), JsValue> {
    if !object.is_object() {
        return Err(wrong_type("an object of options is expected, such as { ratio: 0.1 }"));
    }
    let mut data = OwnedMeshData::default();
    let mut given = Vec::new();
    for (name, value) in entries(object) {
        match name.as_str() {
            "locked" => {
                let flags = value.dyn_ref::<Uint8Array>().map(Uint8Array::to_vec);
                let flags = flags.ok_or_else(|| wrong_type("locked: a Uint8Array is expected"))?;
                data.locked = Some(flags.iter().map(|x| *x != 0).collect());
            }
            "importance" => {
                let factors = value.dyn_ref::<Float32Array>().map(Float32Array::to_vec);
                data.importance =
                    Some(factors.ok_or_else(|| wrong_type("importance: a Float32Array is expected"))?);
            }
            _ => {
                let value = Given::of(&name, &value)?;
                given.push((dashed(&name), value));
            }
        }
    }
    let given: Vec<_> = given.iter().map(|(name, value)| (name.as_str(), value.value())).collect();
    let options = by_name::from_names(&given).map_err(|e| option_error(&e))?;
    if options.stop == Stop::default() && !options.method.ends_without_stop() {
        let text = "a target is needed: faces, vertices, ratio, error, or what the method ends by";
        return Err(wrong_value(text));
    }
    Ok((options, data))
}

/// Returns the data of each mesh of a scene, from lists that name the vertices of one after the other.
///
/// # Errors
/// A list that does not have one entry for each vertex of all meshes.
pub(crate) fn data_of_meshes(
    all: &OwnedMeshData,
    counts: impl Iterator<Item = usize> + Clone,
) -> Result<Vec<OwnedMeshData>, JsValue> {
    let wanted: usize = counts.clone().sum();
    let lengths = [
        ("locked", all.locked.as_ref().map(Vec::len)),
        ("importance", all.importance.as_ref().map(Vec::len)),
    ];
    if let Some((option, Some(got))) = lengths.into_iter().find(|(_, got)| got.is_some_and(|n| n != wanted)) {
        return Err(run_error(&SimplifyError::WrongLength { option, wanted, got }));
    }
    let mut first = 0;
    let part = |count: usize| {
        let own = first..first + count;
        first = own.end;
        let mut data = OwnedMeshData::default();
        data.locked = all.locked.as_ref().map(|list| list[own.clone()].to_vec());
        data.importance = all.importance.as_ref().map(|list| list[own].to_vec());
        data
    };
    Ok(counts.map(part).collect())
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
