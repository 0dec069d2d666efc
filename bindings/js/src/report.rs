//! Reports as objects, with the keys of the command.

use js_sys::{Object, Reflect};
use serde_json::Value;
use wasm_bindgen::JsValue;

use crate::errors::camel_case;

#[cfg(not(feature = "formats"))]
/// Returns an object with these properties.
pub(crate) fn object<const N: usize>(properties: [(&str, JsValue); N]) -> JsValue {
    let object = Object::new();
    for (name, value) in properties {
        set(&object, name, &value);
    }
    object.into()
}

/// Sets a property of an object that this module made, which accepts any property.
pub(crate) fn set(object: &Object, name: &str, value: &JsValue) {
    let done = Reflect::set(object, &name.into(), value);
    debug_assert!(done.is_ok(), "{name} is not set");
}

/// Returns the report of a run, with the names of options in JavaScript.
pub(crate) fn report(mut all: Value) -> JsValue {
    let proposed = all["proposals"].as_array_mut().into_iter().flatten();
    let proposed = proposed.flat_map(|p| p["changes"].as_array_mut().into_iter().flatten());
    proposed.for_each(rename);
    all["escalated"].as_array_mut().into_iter().flatten().for_each(rename);
    // (The text is valid JSON.)
    js_sys::JSON::parse(&all.to_string()).map_or(JsValue::NULL, JsValue::from)
}

/// Replaces the option of a change with its name in JavaScript.
fn rename(change: &mut Value) {
    if let Some(name) = change["option"].as_str() {
        change["option"] = camel_case(&name.replace('_', "-")).into();
    }
}
