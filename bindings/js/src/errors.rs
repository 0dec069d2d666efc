//! Errors as JavaScript errors.

use js_sys::{Error, RangeError, TypeError};
#[cfg(not(feature = "formats"))]
use lodsmith::SimplifyError;
#[cfg(not(feature = "formats"))]
use lodsmith::options::by_name::{OPTIONS, OptionError};
use wasm_bindgen::JsValue;

/// Returns a `TypeError`, for a value of the wrong type.
pub(crate) fn wrong_type(text: &str) -> JsValue {
    TypeError::new(text).into()
}

/// Returns a `RangeError`, for an invalid value of the right type.
pub(crate) fn wrong_value(text: &str) -> JsValue {
    RangeError::new(text).into()
}

/// Returns the error for an option that was rejected.
#[cfg(not(feature = "formats"))]
pub(crate) fn option_error(error: &OptionError) -> JsValue {
    match error {
        OptionError::Unknown { name, nearest } => {
            let similar = nearest.map(|near| format!("; a similar one is {}", camel_case(near)));
            wrong_type(&format!("there is no option {}{}", camel_case(name), similar.unwrap_or_default()))
        }
        OptionError::Value { option, why } => wrong_value(&format!("{}: {why}", camel_case(option))),
        other => wrong_value(&in_camel_case(other.to_string())),
    }
}

/// Replaces names of options with their names in JavaScript.
#[cfg(not(feature = "formats"))]
fn in_camel_case(mut text: String) -> String {
    for option in OPTIONS.iter().filter(|o| o.name.contains('-')) {
        // Values such as `lindstrom-turk` are not changed.
        text = text.replace(option.name, &camel_case(option.name));
    }
    text
}

/// Returns the error for a run that failed, with the names of options in JavaScript.
#[cfg(not(feature = "formats"))]
pub(crate) fn run_error(error: &SimplifyError) -> JsValue {
    if matches!(error, SimplifyError::Cancelled) {
        return cancelled();
    }
    wrong_value(&in_camel_case(error.to_string()))
}

/// Returns the error for a run that was cancelled.
pub(crate) fn cancelled() -> JsValue {
    let error = Error::new("cancelled");
    error.set_name("AbortError");
    error.into()
}

/// Returns the name of an option in JavaScript: `maxNormal` for `max-normal`.
pub(crate) fn camel_case(name: &str) -> String {
    let mut words = name.split('-');
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |mut all, word| {
        let mut letters = word.chars();
        all.extend(letters.next().map(|x| x.to_ascii_uppercase()));
        all + letters.as_str()
    })
}

/// Returns the name of an option on the command line: `max-normal` for `maxNormal`.
pub(crate) fn dashed(name: &str) -> String {
    let mut all = String::with_capacity(name.len() + 2);
    for letter in name.chars() {
        if letter.is_ascii_uppercase() {
            all.push('-');
        }
        all.push(letter.to_ascii_lowercase());
    }
    all
}
